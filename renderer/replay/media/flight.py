"""Free flight and shadow rays in media, collision by collision as in Mitsuba's `volpath`.

A path plays Russian roulette before each flight and each null collision. A shadow ray is
attenuated by ratio tracking [Novak2014] in every medium, homogeneous ones included: there
it arrives whole or not at all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.integrators.stages.media import append_collisions, keep_rays
from renderer.integrators.stages.scatter import MOST_SURVIVAL, largest
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    mask_bits,
    minimum,
    popcount,
    select,
    splat_f32,
    splat_i32,
    splat_mask,
    to_i32,
)
from renderer.kernels.lanes.mathematics import exp
from renderer.kernels.lanes.memory import gather_row, load_row, scatter_row, store_where
from renderer.kernels.lanes.vectors import (
    gather3,
    load3,
    select3,
    store3,
    vec3,
)
from renderer.plugins.media.free_flight import (
    MOST_STEPS,
    albedo_at,
    box_of,
    mean,
    sigma_t_at,
)
from renderer.replay.directions import fused_sum
from renderer.replay.media.record import (
    CHANNEL,
    PASSED,
    draw_depths,
    draw_each,
    pixels_of,
    skip_each,
)

_INFINITE = np.float32(np.inf)


class _Step(NamedTuple):
    """One tentative collision of 16 rays."""

    near: Any  # distance to where the medium begins
    t: Any  # distance to the collision; infinite if there is none before the end
    majorant: Any  # RGB
    varies: Any  # mask: the medium is heterogeneous
    valid: Any  # mask: collides before the medium's and the ray's end, and the surface


@kernel
def _of_channel(color, channel):
    return select(channel == 0, color.x, select(channel == 1, color.y, color.z))


@kernel
def _collide(order, medium, channel, origin, direction, end, surface, depth, inside):
    """Choose the tentative collision at an optical depth, before `end` and the surface."""
    media = order.scene.media
    varies = inside & (gather_row(media.majorant, 0, medium, inside) > 0.0)
    grey = gather_row(order.majorant, 0, medium, varies)
    majorant = gather3(media.sigma_t, medium, inside)
    majorant = select3(varies, vec3(grey, grey, grey), majorant)
    near, far = splat_f32(0.0), end
    open_ = inside
    if mask_bits(varies) != 0:
        first, last = box_of(media, medium, origin, direction, end, varies)
        near = select(varies & (first <= last), first, near)
        far = select(varies, last, far)
        open_ = inside & (~varies | (first <= last))
    sigma = _of_channel(majorant, channel)
    t = near + select(sigma > 0.0, depth / sigma, splat_f32(_INFINITE))
    valid = open_ & (t <= far) & (t < _INFINITE) & ~(surface < t)
    t = select(valid, t, splat_f32(_INFINITE))
    return _Step(near, t, majorant, varies, valid)


@kernel
def _transmittance_over_pdf(step, end, channel, crossed):
    """Return T over the density of the channel's flight up to `end`, RGB; 0 for 0 / 0.

    `crossed`: the flight has ended at a surface, and its density is a probability.
    """
    way = end - step.near
    far = ~(way < _INFINITE)
    way = select(far, splat_f32(0.0), way)
    majorant = step.majorant
    t = vec3(exp(-way * majorant.x), exp(-way * majorant.y), exp(-way * majorant.z))
    density = select3(crossed, t, t * majorant)
    pdf = _of_channel(density, channel)
    usable = (pdf > 0.0) & ~far
    return t * select(usable, 1.0 / select(usable, pdf, splat_f32(1.0)), splat_f32(0.0))


@kernel
def _any_of(color):
    return (color.x != 0.0) | (color.y != 0.0) | (color.z != 0.0)


@kernel
def _rcp(x, mask):
    return 1.0 / select(mask, x, splat_f32(1.0))


@kernel
def _event(media, medium, at, step, spectral, v):
    """Return which collisions are null, and the weights of what happens, RGB."""
    valid, majorant = step.valid, step.majorant
    sigma_t = sigma_t_at(media, medium, at, valid)
    sigma_n = select3(step.varies, majorant - sigma_t, sigma_t * 0.0)
    sigma_s = sigma_t * albedo_at(media, medium, at, valid)
    share_of_null = mean(sigma_n / majorant)
    null = valid & (v < share_of_null)
    share = select(null, share_of_null, mean(sigma_t / majorant))
    one = splat_f32(1.0)
    of_null = select3(spectral, sigma_n * _rcp(share, valid), vec3(one, one, one))
    of_real = select3(spectral, sigma_s * _rcp(share, valid), sigma_s / sigma_t)
    return null, select3(null, of_null, of_real)


@kernel
def fly_in_order(order, tile, sample, work, count):
    """Do as `stages.media.fly`: return how many rays reach their surface, and collide."""
    scene, replay, state = order.scene, order.replay, work.media
    rays, hits, points, numbers = work.rays, work.hits, state.collisions, work.numbers
    settings, media = scene.settings, scene.media
    hides = settings.hide_emitters != 0
    kept, collisions = np.int64(0), np.int64(0)
    for i in range(0, count, 16):
        on = first_lanes(count - i)
        slot = load_row(rays.slot, 0, i)
        medium = gather_row(state.medium, 0, slot, on)
        depth = gather_row(state.depth, 0, slot, on)
        pixel = pixels_of(tile, slot)
        channel = to_i32(gather_row(replay.numbers, CHANNEL, pixel, on))
        throughput, eta = load3(rays.throughput, i), load_row(rays.eta, 0, i)
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        missed = load_row(hits.prim, 0, i) < 0
        # media go on behind the camera's far plane
        surface = select(missed, splat_f32(_INFINITE), load_row(hits.t, 0, i))
        reaches, collided = splat_mask(False), splat_mask(False)
        steps = 0
        while mask_bits(on) != 0 and steps < MOST_STEPS:
            steps += 1
            # Russian roulette, at every flight
            on = on & _any_of(throughput)
            u = draw_each(replay, tile, sample, rays.slot, i, on, numbers)
            survival = minimum(largest(throughput) * (eta * eta), splat_f32(MOST_SURVIVAL))
            plays = on & (depth > np.int32(settings.roulette_depth))
            on = on & (~plays | (u < survival))
            plays = plays & on
            throughput = select3(plays, throughput * _rcp(survival, plays), throughput)
            on = on & (depth < np.int32(settings.max_depth))
            inside = on & (medium >= 0)
            reaches = reaches | (on & ~inside)
            if mask_bits(inside) == 0:
                break

            u = draw_depths(replay, tile, sample, rays.slot, i, inside, numbers)
            end = splat_f32(_INFINITE)
            step = _collide(
                order, medium, channel, origin, direction, end, surface, u, inside
            )
            spectral = inside & (gather_row(order.spectral, 0, medium, inside) != 0)
            passed = _transmittance_over_pdf(
                step, minimum(step.t, surface), channel, surface < step.t
            )
            throughput = select3(spectral, throughput * passed, throughput)
            escaped, valid = inside & ~step.valid, step.valid
            reaches = reaches | escaped
            skip_each(replay, tile, rays.slot, i, escaped)
            v = draw_each(replay, tile, sample, rays.slot, i, valid, numbers)
            if mask_bits(valid) == 0:
                break

            at = fused_sum(direction, select(valid, step.t, splat_f32(0.0)), origin)
            null, factor = _event(media, medium, at, step, spectral, v)
            real = valid & ~null
            throughput = select3(valid, throughput * factor, throughput)
            origin = select3(null, at, origin)
            surface = select(null, surface - step.t, surface)
            depth = select(real, depth + 1, depth)
            scatters = real & (depth < np.int32(settings.max_depth))
            collided = collided | scatters
            origin = select3(scatters, at, origin)
            on = null
        scatter_row(state.depth, 0, slot, depth, collided)
        collisions = append_collisions(
            points,
            collisions,
            origin,
            direction,
            throughput,
            medium,
            slot,
            eta,
            collided,
        )
        if hides:  # the camera does not see the environment, through media either
            reaches = reaches & (~missed | (depth > 0))
        keep_rays(rays, hits, i, kept, throughput, reaches)
        kept += popcount(mask_bits(reaches))
    return kept, collisions


@kernel
def attenuate_in_order(order, tile, sample, work, count):
    """Take `count` shadow rays to what they have hit; note what arrives at the light.

    Rays that end on the way, or arrive, have hit nothing afterwards.
    """
    scene, replay, state = order.scene, order.replay, work.media
    media, rays, hits, numbers = scene.media, state.rays, state.hits, work.numbers
    for i in range(0, count, 16):
        there = first_lanes(count - i)
        slot, ray = load_row(rays.slot, 0, i), load_row(rays.point, 0, i)
        medium = gather_row(state.inside, 0, ray, there)
        rest = gather_row(state.rest, 0, ray, there)
        pixel = pixels_of(tile, slot)
        channel = to_i32(gather_row(replay.numbers, CHANNEL, pixel, there))
        throughput = load3(rays.throughput, i)
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        missed = load_row(hits.prim, 0, i) < 0
        surface = select(missed, splat_f32(_INFINITE), load_row(hits.t, 0, i))
        arrives = there & missed
        on = there & (medium >= 0)
        steps = 0
        while mask_bits(on) != 0 and steps < MOST_STEPS:
            steps += 1
            over = on & ~(rest > 0.0)
            arrives = arrives | over
            on = on & ~over
            u = draw_depths(replay, tile, sample, rays.slot, i, on, numbers)
            step = _collide(order, medium, channel, origin, direction, rest, surface, u, on)
            end = minimum(rest, minimum(step.t, surface))
            crossed = (surface < step.t) | (step.t > rest)
            spectral = on & (gather_row(order.spectral, 0, medium, on) != 0)
            passed = _transmittance_over_pdf(step, end, channel, crossed)
            throughput = select3(spectral, throughput * passed, throughput)
            on = valid = step.valid
            if mask_bits(valid) == 0:
                break
            t = select(valid, step.t, splat_f32(0.0))
            at = fused_sum(direction, t, origin)
            sigma_t = sigma_t_at(media, medium, at, valid)
            left = select3(step.varies, step.majorant - sigma_t, sigma_t * 0.0)
            ratio = select3(spectral, left, left / step.majorant)
            throughput = select3(valid, throughput * ratio, throughput)
            origin, rest, surface = at, rest - t, surface - t
            on = valid & _any_of(throughput)
            arrives = arrives & ~(valid & ~on)
        store3(rays.throughput, i, throughput)
        scatter_row(replay.numbers, PASSED, pixel, throughput.x, arrives)
        scatter_row(replay.numbers, PASSED + 1, pixel, throughput.y, arrives)
        scatter_row(replay.numbers, PASSED + 2, pixel, throughput.z, arrives)
        ended = arrives | ~_any_of(throughput) | on  # on: after too many steps
        store_where(hits.prim, 0, i, splat_i32(-1), ended)
