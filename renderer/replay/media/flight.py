"""Free flight and shadow rays in media, collision by collision as in Mitsuba.

A path plays Russian roulette before each flight and, except in `volpathmis`, after each
null collision. A shadow ray is attenuated by ratio tracking [Novak2014] in heterogeneous
and homogeneous media. In a homogeneous medium it either arrives unattenuated or is lost.
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
from renderer.replay.media.carried import (
    Collision,
    after_collision,
    after_flight,
    after_ratio,
    any_of,
    channel_of,
    goes_on,
    grey,
    keep_path,
    keep_shadow_ray,
    load_path,
    load_shadow_ray,
    of_channel,
    own_throughput,
    raised,
    worth,
)
from renderer.replay.media.record import (
    draw_depths,
    draw_each,
    pixels_of,
    skip_each,
)

_INFINITE = np.float32(np.inf)


class _Step(NamedTuple):
    """One tentative collision of 16 rays."""

    near: Any  # distance to the beginning of the medium
    t: Any  # distance to the collision; infinite if there is none before the end
    majorant: Any  # RGB
    varies: Any  # mask: the medium is heterogeneous
    valid: Any  # mask: before the end of the medium and of the ray, and before the surface


@kernel
def _collide(order, medium, channel, origin, direction, end, surface, depth, inside):
    """Return the tentative collision at an optical depth, before `end` and the surface."""
    media = order.scene.media
    varies = inside & (gather_row(media.majorant, 0, medium, inside) > 0.0)
    majorant = gather3(media.sigma_t, medium, inside)
    of_grid = grey(gather_row(order.majorant, 0, medium, varies))
    majorant = select3(varies, of_grid, majorant)
    near, far = splat_f32(0.0), end
    open_ = inside
    if mask_bits(varies) != 0:
        first, last = box_of(media, medium, origin, direction, end, varies)
        near = select(varies & (first <= last), first, near)
        far = select(varies, last, far)
        open_ = inside & (~varies | (first <= last))
    sigma = of_channel(majorant, channel)
    t = near + select(sigma > 0.0, depth / sigma, splat_f32(_INFINITE))
    valid = open_ & (t <= far) & (t < _INFINITE) & ~(surface < t)
    t = select(valid, t, splat_f32(_INFINITE))
    return _Step(near, t, majorant, varies, valid)


@kernel
def _flown(step, end, crossed):
    """Return the transmittance up to `end` and the density of such a flight, RGB.

    `crossed`: the flight ended at a surface, and its density is a probability.
    """
    way = end - step.near
    far = ~(way < _INFINITE)
    way, majorant = select(far, splat_f32(0.0), way), step.majorant
    t = vec3(exp(-way * majorant.x), exp(-way * majorant.y), exp(-way * majorant.z))
    t = select3(far, grey(splat_f32(0.0)), t)
    return t, select3(crossed, t, t * majorant)


@kernel
def _collision(media, medium, at, step, spectral, v):
    """Return the medium at valid tentative collisions; null if its share exceeds v."""
    valid, majorant = step.valid, step.majorant
    sigma_t = sigma_t_at(media, medium, at, valid)
    sigma_n = select3(step.varies, majorant - sigma_t, sigma_t * 0.0)
    share = mean(sigma_n / majorant)
    null = valid & (v < share)
    sigma_s = sigma_t * albedo_at(media, medium, at, valid & ~null)
    return Collision(null, share, majorant, sigma_n, sigma_s, sigma_t, spectral)


@kernel
def fly_in_order(order, tile, sample, work, count):
    """Fly as `stages.media.fly`; return the numbers of rays at surfaces and collisions."""
    scene, replay, state, carry = order.scene, order.replay, work.media, order.carry
    rays, hits, points, numbers = work.rays, work.hits, state.collisions, work.numbers
    settings, media, mis = scene.settings, scene.media, splat_mask(order.mis != 0)
    hides = settings.hide_emitters != 0
    kept, collisions = np.int64(0), np.int64(0)
    for i in range(0, count, 16):
        there = on = first_lanes(count - i)
        slot = load_row(rays.slot, 0, i)
        medium = gather_row(state.medium, 0, slot, on)
        depth = gather_row(state.depth, 0, slot, on)
        pixel = pixels_of(tile, slot)
        channel = channel_of(replay.numbers, pixel, on)
        carried = load_path(carry, pixel, load3(rays.throughput, i), on)
        eta = load_row(rays.eta, 0, i)
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        missed = load_row(hits.prim, 0, i) < 0
        # a flight may go to the camera's far plane, and a ray without a hit beyond it
        length, infinite = load_row(hits.t, 0, i), splat_f32(_INFINITE)
        surface, end = select(missed, infinite, length), select(missed, length, infinite)
        reaches = collided = after_null = splat_mask(False)
        steps = 0
        while mask_bits(on) != 0 and steps < MOST_STEPS:
            steps += 1
            # Russian roulette before every flight
            on = on & (mis | any_of(worth(carried)))
            u = draw_each(replay, tile, sample, rays.slot, i, on, numbers)
            survival = largest(worth(carried)) * (eta * eta)
            survival = minimum(survival, splat_f32(MOST_SURVIVAL))
            plays = on & (depth > np.int32(settings.roulette_depth)) & ~(mis & after_null)
            on = on & (~plays | (u < survival))
            carried = raised(carried, survival, plays & on)
            on = on & (depth < np.int32(settings.max_depth)) & any_of(worth(carried))
            inside = on & (medium >= 0)
            reaches = reaches | (on & ~inside)
            if mask_bits(inside) == 0:
                break

            u = draw_depths(replay, tile, sample, rays.slot, i, inside, numbers)
            step = _collide(
                order, medium, channel, origin, direction, end, surface, u, inside
            )
            spectral = inside & (gather_row(order.spectral, 0, medium, inside) != 0)
            t, density = _flown(step, minimum(step.t, surface), surface < step.t)
            carried = after_flight(carried, t, density, spectral)
            escaped, valid = inside & ~step.valid, step.valid
            reaches = reaches | escaped
            if order.mis == 0:
                skip_each(replay, tile, rays.slot, i, escaped)
            v = draw_each(replay, tile, sample, rays.slot, i, valid, numbers)
            if mask_bits(valid) == 0:
                break

            at = fused_sum(direction, select(valid, step.t, splat_f32(0.0)), origin)
            collision = _collision(media, medium, at, step, spectral, v)
            null = after_null = collision.null
            real = valid & ~null
            carried = after_collision(carried, collision, valid)
            origin = select3(null, at, origin)
            surface = select(null, surface - step.t, surface)
            depth = select(real, depth + 1, depth)
            scatters = real & (depth < np.int32(settings.max_depth))
            collided = collided | scatters
            origin = select3(scatters, at, origin)
            on = null
        scatter_row(state.depth, 0, slot, depth, collided)
        keep_path(carry, carried, pixel, there)
        throughput = own_throughput(carried)
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
        if hides:  # a hidden environment is hidden through media too
            reaches = reaches & (~missed | (depth > 0))
        keep_rays(rays, hits, i, kept, throughput, reaches)
        kept += popcount(mask_bits(reaches))
    return kept, collisions


@kernel
def attenuate_in_order(order, tile, sample, work, count):
    """Trace `count` shadow rays up to their hits; store what reaches the light.

    Rays that end on the way or reach the light are marked as misses.
    """
    scene, replay, state, carry = order.scene, order.replay, work.media, order.carry
    media, rays, hits, numbers = scene.media, state.rays, state.hits, work.numbers
    for i in range(0, count, 16):
        there = first_lanes(count - i)
        slot, ray = load_row(rays.slot, 0, i), load_row(rays.point, 0, i)
        medium = gather_row(state.inside, 0, ray, there)
        rest = gather_row(state.rest, 0, ray, there)
        pixel = pixels_of(tile, slot)
        channel = channel_of(replay.numbers, pixel, there)
        carried = load_shadow_ray(carry, pixel, load3(rays.throughput, i), there)
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
            t, density = _flown(step, end, crossed)
            carried = after_flight(carried, t, density, spectral)
            on = valid = step.valid
            if mask_bits(valid) == 0:
                break
            far = select(valid, step.t, splat_f32(0.0))
            at = fused_sum(direction, far, origin)
            # all collisions are null
            collision = _collision(media, medium, at, step, spectral, splat_f32(-1.0))
            carried = after_ratio(carried, collision, valid)
            origin, rest, surface = at, rest - far, surface - far
            on = valid & goes_on(carried)
            arrives = arrives & ~(valid & ~on)
        # a shadow ray also ends at throughput 0, and (`on`) after too many steps
        ended = arrives | ~goes_on(carried) | on
        keep_shadow_ray(carry, carried, pixel, there, arrives)
        store3(rays.throughput, i, own_throughput(carried))
        store_where(hits.prim, 0, i, splat_i32(-1), ended)
