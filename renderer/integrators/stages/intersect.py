"""Stage 2, intersection: the nearest hit over all primitive groups, and visibility."""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.camera_rays import camera_rays
from renderer.kernels.jit import call, entry_kernel, kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.memory import (
    append_row,
    load_one,
    load_row,
    store_one,
    store_row,
)
from renderer.kernels.records.batch import has_places, square_of
from renderer.kernels.records.kernel_scene import (
    ANY_COHERENT,
    ANY_SINGLE,
    CLOSEST,
    CLOSEST_COHERENT,
    RECORD,
)


@kernel
def reset_hits(hits, first, count):
    """Set `count` rays to an infinite t_max and no hit."""
    for i in range(first, first + count, 16):
        store_row(hits.t, 0, i, splat_f32(np.float32(np.inf)))
        store_row(hits.prim, 0, i, splat_i32(-1))


@kernel
def intersect(groups, rays, hits, first, count, coherent, tally):
    """Find the nearest hits of `count` rays; `hits.t` holds each ray's t_max on entry.

    The traversal counters are added to `tally`, unless it is None.
    """
    way = CLOSEST_COHERENT if coherent else CLOSEST
    for k in range(groups.shape[0]):
        call(groups[k, way], groups[k, RECORD], (rays, hits, first, count, tally))


@entry_kernel
def nearest_hits(groups, work, count):
    """Find the nearest hits of the first `count` of `work.rays`, without a t_max."""
    first = np.int64(0)
    reset_hits(work.hits, first, count)
    intersect(groups, work.rays, work.hits, first, count, False, None)


@kernel
def camera_hits(scene, tile, sample, work):
    """Trace the camera rays of a tile's squares; return the number of rays.

    The squares are adjacent, and their rays are traced together.
    """
    count = np.int64(0)
    for number in range(tile.square, tile.square + tile.squares):
        square = square_of(tile, number)
        if has_places(square):
            first = count
            count = camera_rays(scene, square, sample, work, first)
            groups = scene.camera_groups
            intersect(groups, work.rays, work.hits, first, count - first, True, None)
    return count


@kernel
def trace_shadow_rays(groups, shadow_rays, count, coherent, radiance):
    """Add the radiance of the unoccluded shadow rays to their pixels."""
    for i in range(0, count, 16):
        store_row(shadow_rays.blocked, 0, i, splat_i32(0))
    way = ANY_COHERENT if coherent else ANY_SINGLE
    for k in range(groups.shape[0]):
        call(groups[k, way], groups[k, RECORD], (shadow_rays, count, None))
    # Compact the unoccluded rays to the front, in place. A branch for each ray would be
    # mispredicted about half of the time.
    free = np.int64(0)
    for i in range(0, count, 16):
        lit = (load_row(shadow_rays.blocked, 0, i) == 0) & first_lanes(count - i)
        append_row(shadow_rays.blocked, 0, free, lane_index() + i, lit)
        free += popcount(mask_bits(lit))
    for k in range(free):  # scalar: two rays may belong to the same pixel
        i = np.int64(load_one(shadow_rays.blocked, 0, k))
        slot = np.int64(load_one(shadow_rays.slot, 0, i))
        for c in range(3):
            carried = load_one(shadow_rays.radiance, c, i)
            store_one(radiance, c, slot, load_one(radiance, c, slot) + carried)
