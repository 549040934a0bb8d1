"""Direct light in fog at an equiangular point of each segment that passes near a lamp.

Free flight samples collisions by the density of the fog. Collisions close to a small lamp
are then rare and bright, which is noise. So a segment that passes a lamp gets one more
point by equiangular sampling. A light sample is taken there and at the collision. The
balance heuristic over the distance t [Veach1997, section 9.2] weights each with the
throughput T sigma_s / (p_flight + p_equiangular). The path itself continues from its
collision without this weight.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.media import append_collisions
from renderer.integrators.stages.media_shadows import light_collisions
from renderer.kernels.jit import call, kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    splat_f32,
)
from renderer.kernels.lanes.memory import append_row, gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.kernels.records.kernel_scene import DRAW, RECORD
from renderer.plugins.media.equiangular import (
    is_uneven,
    light_at,
    sample_place,
    segment_end,
)
from renderer.plugins.media.free_flight import albedo_at, attenuated_sigma_t, mean
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE

# Blocks of a bounce: 2 draws the lights of collisions, 3 those of these points (`turn` 1),
# and this one draws the distance
_PLACE = 4


@kernel
def light_near_lamps(scene, tile, sample, step, work, count, lamps):
    """Add the direct light at equiangular points of those of `count` segments near lamps.

    The points are stored in `work.media.collisions`, before the collisions themselves.
    """
    found = _choose_segments(scene, work, count, lamps)
    if found == 0:
        return
    media, points, numbers = scene.media, work.media.collisions, work.numbers
    call(
        scene.sampler[0, DRAW],
        scene.sampler[0, RECORD],
        (tile, sample, _PLACE + step * BLOCKS_PER_BOUNCE, points.slot, found, numbers),
    )
    for i in range(0, found, 16):
        mine, medium = first_lanes(found - i), load_row(points.bsdf, 0, i)
        origin, direction = load3(points.position, i), -load3(points.wo, i)
        end, x = load_row(points.t, 0, i), load_row(numbers, 0, i)
        t, total = sample_place(lamps, origin, direction, end, x)
        store_row(points.offset, 0, i, total)
        passed = attenuated_sigma_t(media, medium, t, mine)
        density = mean(passed) + light_at(lamps, origin, direction, t) / total
        at = origin + direction * t
        passed = passed * albedo_at(media, medium, at, mine) * (1.0 / density)
        store3(points.position, i, at)
        store3(points.throughput, i, load3(points.throughput, i) * passed)
        store_row(points.pdf, 0, i, splat_f32(1.0))
    for k in range(found):
        work.media.lit[points.prim[k]] = points.offset[k]
    light_collisions(scene, tile, sample, step, work, found, np.int64(1), lamps)


@kernel
def _choose_segments(scene, work, count, lamps):
    """Append the segments in fog that pass near lamps to the collisions; return how many.

    `position` is the ray's origin, `t` the end of the segment and `prim` the ray's index.
    """
    media, state = scene.media, work.media
    rays, hits, points = work.rays, work.hits, state.collisions
    last = scene.settings.max_depth - 1
    found = np.int64(0)
    for i in range(0, count, 16):
        store_row(state.lit, 0, i, splat_f32(0.0))
        valid, slot = first_lanes(count - i), load_row(rays.slot, 0, i)
        medium = gather_row(state.medium, 0, slot, valid)
        depth = gather_row(state.depth, 0, slot, valid)
        inside = valid & (medium >= 0) & (depth < np.int32(last))
        # the same end as in `fly`, or the two MIS weights would not sum to 1
        end = segment_end(media, medium, load_row(hits.t, 0, i), inside)
        inside = inside & (end > 0.0)
        if mask_bits(inside) == 0:
            continue
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        near = inside & is_uneven(lamps, origin, direction, end)
        append_row(points.t, 0, found, end, near)
        append_row(points.prim, 0, found, lane_index() + np.int32(i), near)
        ray, eta = load3(rays.throughput, i), load_row(rays.eta, 0, i)
        found = append_collisions(
            points, found, origin, direction, ray, medium, slot, eta, near
        )
    return found
