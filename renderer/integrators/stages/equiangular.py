"""Direct light in fog at a second place of each segment: near small lamps.

A free flight collides where the fog is, not where a lamp lights it. The light of a small
lamp falls with 1 / r^2, so the few collisions next to it are bright, and noise. Here each
segment gets one more point, with the density of 1 / r^2 along it: by the angle under which
the lamp sees the segment [Kulla2012]. Of n lamps it is that of the sum of I / r^2.

Both points take a light sample, weighed by the balance heuristic over the distance alone
[Veach1997, section 9.2]: T sigma_s / (p_flight + p_equiangular) at either.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.media_shadows import light_collisions
from renderer.integrators.stages.scatter import largest
from renderer.kernels.jit import call, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import arctan2, sincos
from renderer.kernels.lanes.memory import append_row, gather_row, load_one, load_row
from renderer.kernels.lanes.vectors import column3, dot, load3
from renderer.integrators.stages.media import append_collisions
from renderer.kernels.records.kernel_scene import DRAW, RECORD
from renderer.plugins.media.free_flight import albedo_at, density_of_flight, through
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE

# rows of the table of lamps
_RADIUS2, _STRENGTH, _STEPS = 3, 4, 5
_NEAR2 = np.float32(1e-6)


@kernel
def _seen(lamps, k, origin, direction, end):
    """Return how lamp k sees segments: t of its foot, its distance, and two angles."""
    to_lamp = column3(lamps, 0, k) - origin
    foot = dot(to_lamp, direction)
    across = to_lamp - direction * foot
    d2 = dot(across, across) + load_one(lamps, _RADIUS2, k)
    d = sqrt(maximum(d2, foot * foot * _NEAR2 + np.float32(1e-20)))
    return foot, d, arctan2(-foot, d), arctan2(end - foot, d)


@kernel
def _total(lamps, origin, direction, end):
    """Return the integral of the sum of I / r^2 over segments."""
    total = splat_f32(0.0)
    for k in range(lamps.shape[1]):
        _, d, first, last = _seen(lamps, k, origin, direction, end)
        total = total + (last - first) / d * load_one(lamps, _STRENGTH, k)
    return total


@kernel
def _at(lamps, origin, direction, t):
    """Return the sum of I / r^2 at t."""
    total = splat_f32(0.0)
    for k in range(lamps.shape[1]):
        foot, d, _, _ = _seen(lamps, k, origin, direction, t)
        r2 = d * d + (t - foot) * (t - foot)
        total = total + load_one(lamps, _STRENGTH, k) / r2
    return total


@kernel
def equiangular_density(lamps, origin, direction, end, t):
    """Return the density [1/length] of the second point at t."""
    return _at(lamps, origin, direction, t) / _total(lamps, origin, direction, end)


@kernel
def _sample(lamps, origin, direction, end, x):
    """Return t with that density, from x in [0, 1)."""
    left = _total(lamps, origin, direction, end) * x
    t, open_ = splat_f32(0.0), left >= 0.0
    for k in range(lamps.shape[1]):
        foot, d, first, last = _seen(lamps, k, origin, direction, end)
        strength = load_one(lamps, _STRENGTH, k)
        part = (last - first) / d * strength
        sine, cosine = sincos(first + left * d / strength)
        t = select(open_, foot + d * (sine / cosine), t)
        open_ = open_ & ~(left < part)
        left = left - part
    return minimum(maximum(t, splat_f32(0.0)), end)


@kernel
def flight_share(scene, step, medium, origin, direction, end, t, mask):
    """Return the weights of collisions at t, for their light samples alone."""
    if step >= scene.fog_lamps[_STEPS, 0]:
        return splat_f32(1.0)
    mask = mask & ~(gather_row(scene.media.majorant, 0, medium, mask) > 0.0)
    flight = density_of_flight(scene.media, medium, t, mask)
    other = equiangular_density(scene.fog_lamps, origin, direction, end, t)
    return select(mask, flight / (flight + other), splat_f32(1.0))


@kernel
def light_segments(scene, tile, sample, step, work, count):
    """Add the direct light at one more point of each of `count` segments in fog."""
    media, state, lamps = scene.media, work.media, scene.fog_lamps
    rays, hits, points, numbers = work.rays, work.hits, work.media.collisions, work.numbers
    if step >= lamps[_STEPS, 0]:
        return
    block = 5 + step * BLOCKS_PER_BOUNCE
    call(
        scene.sampler[0, DRAW],
        scene.sampler[0, RECORD],
        (tile, sample, block, rays.slot, count, numbers),
    )
    last = scene.settings.max_depth - 1
    found = np.int64(0)
    for i in range(0, count, 16):
        valid, slot = first_lanes(count - i), load_row(rays.slot, 0, i)
        medium = gather_row(state.medium, 0, slot, valid)
        depth = gather_row(state.depth, 0, slot, valid)
        inside = valid & (medium >= 0) & (depth < np.int32(last))
        inside = inside & ~(gather_row(media.majorant, 0, medium, inside) > 0.0)
        if mask_bits(inside) == 0:
            continue
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        missed = load_row(hits.prim, 0, i) < 0
        end = select(missed, splat_f32(np.float32(np.inf)), load_row(hits.t, 0, i))
        t = _sample(lamps, origin, direction, end, load_row(numbers, 0, i))
        density = density_of_flight(media, medium, t, inside)
        density = density + equiangular_density(lamps, origin, direction, end, t)
        at = origin + direction * t
        scattered = through(media, medium, t, inside) * albedo_at(media, medium, at, inside)
        throughput = load3(rays.throughput, i) * scattered * (1.0 / density)
        some = inside & (fabs(largest(throughput)) > 0.0)
        append_row(points.pdf, 0, found, splat_f32(1.0), some)
        found = append_collisions(
            points, found, at, direction, throughput, medium, slot,
            load_row(rays.eta, 0, i), some,
        )
    light_collisions(scene, tile, sample, step, work, found, np.int64(1), True)
