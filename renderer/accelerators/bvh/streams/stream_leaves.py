"""Leaves of streams: test the rays one by one against eight primitives, or 16 rays at once.

Leaves of large meshes hold seven of eight primitives on average. With AVX2 even 16 rays
take no longer one by one than together. Fewer rays take less time, and one by one no hit
is gathered or scattered.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.wide.octants import DIRECTION, ENDED, ORIGIN, T
from renderer.accelerators.bvh.wide.one_ray_leaves import (
    count_block,
    held,
    intersect_block,
)
from renderer.accelerators.rays.packets import Nearest, nearest_of
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    mask_bits,
    select,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.memory import (
    gather_columns,
    gather_row,
    load_one,
    load_row,
    scatter_row,
)
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.shapes.blocks import WIDTH


@kernel
def intersect_leaf(blocks, block, query, rays, lists, place, m, tally):
    """Test the rays of a list against the primitives of a leaf."""
    if HAS_AVX2_ONLY:
        intersect_one_by_one(blocks, block, block + 1, query, rays, lists, place, m, tally)
        return
    if tally is not None:
        for j in range(place, place + m):
            if rays.for_boxes[T, lists[j]] >= 0.0:
                count_block(tally, blocks, block, rays.number[lists[j]])
    start = WIDTH * block
    end = start + held(blocks, block)
    intersect_together(blocks, start, end, query, rays, lists, place, m)


@kernel
def intersect_one_by_one(blocks, first, end, query, rays, lists, place, m, tally):
    """Test each ray of a list against the primitives of blocks first to end - 1."""
    for j in range(place, place + m):
        ray = np.int64(load_one(lists, 0, j))
        for block in range(first, end):
            if load_one(rays.for_boxes, T, ray) >= 0.0:
                intersect_block(blocks, block, query, rays, ray, tally)


@kernel
def intersect_together(primitives, start, end, query, rays, lists, place, m):
    """Test 16 rays of a list at a time against each primitive."""
    zero = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        number = gather_row(rays.number, 0, ray, live)
        ox, oy, oz, _ = gather_columns(rays.for_leaves, ORIGIN, ray, live)
        dx, dy, dz, _ = gather_columns(rays.for_leaves, DIRECTION, ray, live)
        origin, direction = vec3(ox, oy, oz), vec3(dx, dy, dz)
        t = select(live, gather_row(rays.for_boxes, T, ray, live), ENDED)
        prim = gather_row(query.prim, 0, number, live)
        prim = splat_i32(-1) if query.any_hit != 0 else prim
        before = Nearest(t, prim, t, t)  # any u and v: no hit yet
        near = nearest_of(
            primitives, start, end, origin, direction, before, None, zero, zero
        )
        found = live & (near.prim != prim)
        if mask_bits(found) != 0:  # an empty scatter takes as long as any other
            _store(query, rays, ray, number, near, found)


@kernel
def _store(query, rays, ray, number, near, found):
    if query.any_hit != 0:
        scatter_row(rays.for_boxes, T, ray, splat_f32(ENDED), found)
        scatter_row(query.prim, 0, number, splat_i32(1), found)
        return
    scatter_row(rays.for_boxes, T, ray, near.t, found)
    scatter_row(query.ends, 0, number, near.t, found)
    scatter_row(query.prim, 0, number, near.prim, found)
    scatter_row(query.u, 0, number, near.u, found)
    scatter_row(query.v, 0, number, near.v, found)
