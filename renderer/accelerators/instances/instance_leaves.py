"""What the rays of a list meet in a leaf of a group: together, or ray by ray."""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.wide.octants import ENDED
from renderer.accelerators.bvh.wide.one_ray_leaves import hit_block, nearest_in_block
from renderer.accelerators.instances.instance_rays import (
    DIRECTION,
    ORIGIN,
    PRIM,
    SHORT,
    T,
    U,
    V,
)
from renderer.accelerators.rays.packets import Nearest, nearest_of
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    mask_bits,
    select,
    splat_f32,
)
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.memory import (
    gather_row,
    load_one,
    load_row,
    scatter_row,
    store_one,
)
from renderer.kernels.lanes.vectors import column3, gather_rows3

# words of a leaf of primitives
FIRST = 0  # its first primitive
END = 1
KIND = 2  # which of the kinds of primitives, by their place in `Instances`
TOGETHER = 3  # leaves from this one on that are tested together, one of each kind
LEAF_WORDS = 4


@kernel
def intersect_leaf(instances, leaf, any_hit, rows, lists, place, m):
    """Test the rays of a list against the primitives of a leaf, which are of one kind."""
    first = np.int64(load_one(instances.leaves, 0, leaf + FIRST))
    end = np.int64(load_one(instances.leaves, 0, leaf + END))
    kind = load_one(instances.leaves, 0, leaf + KIND)
    if kind == 0:
        _meet(instances.triangles, first, end, any_hit, rows, lists, place, m)
    elif kind == 1:
        _meet(instances.rectangles, first, end, any_hit, rows, lists, place, m)
    elif kind == 2:
        _meet(instances.disks, first, end, any_hit, rows, lists, place, m)
    elif kind == 3:
        _meet(instances.spheres, first, end, any_hit, rows, lists, place, m)
    elif kind == 4:
        _meet(instances.cylinders, first, end, any_hit, rows, lists, place, m)
    elif kind == 5:
        _meet_together(instances.implicits, first, end, any_hit, rows, lists, place, m)
    else:
        _meet_together(instances.sdf_cells, first, end, any_hit, rows, lists, place, m)


@kernel
def _meet(primitives, first, end, any_hit, rows, lists, place, m):
    """Test the rays of a list against primitives in blocks of eight."""
    if primitives is None:
        return
    if m > SHORT and not HAS_AVX2_ONLY:
        _meet_together(primitives, first, end, any_hit, rows, lists, place, m)
        return
    for j in range(m):
        ray = np.int64(load_one(lists, 0, place + j))
        for block in range(first >> 3, (end + 7) >> 3):
            if load_one(rows.floats, T, ray) >= 0.0:
                _meet_block(primitives, block, any_hit, rows, ray)


@kernel
def _meet_block(blocks, block, any_hit, rows, ray):
    """Test one ray against eight primitives."""
    floats, integers = rows.floats, rows.integers
    t_before = load_one(floats, T, ray)
    origin, direction = column3(floats, ORIGIN, ray), column3(floats, DIRECTION, ray)
    x = hit_block(blocks, block, origin, direction, t_before)
    if mask_bits(x.hit) == 0:
        return
    if any_hit != 0:
        store_one(floats, T, ray, ENDED)
        return
    near = nearest_in_block(blocks, block, x)
    prim_before = load_one(integers, PRIM, ray)
    if near.t < t_before or prim_before < 0 or near.prim < prim_before:
        store_one(floats, T, ray, near.t)
        store_one(integers, PRIM, ray, near.prim)
        store_one(floats, U, ray, near.u)
        store_one(floats, V, ray, near.v)


@kernel
def _meet_together(primitives, first, end, any_hit, rows, lists, place, m):
    """Test each 16 rays against one primitive after the other."""
    if primitives is None:
        return
    floats, integers = rows.floats, rows.integers
    zero = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        origin = gather_rows3(floats, ORIGIN, ray, live)
        direction = gather_rows3(floats, DIRECTION, ray, live)
        t = select(live, gather_row(floats, T, ray, live), ENDED)
        prim = gather_row(integers, PRIM, ray, live)
        before = Nearest(t, prim, t, t)  # u and v as good as any: no hit yet
        near = nearest_of(
            primitives, first, end, origin, direction, before, None, zero, zero
        )
        found = live & (near.prim != prim)
        if mask_bits(found) == 0:
            continue
        if any_hit != 0:
            scatter_row(floats, T, ray, splat_f32(ENDED), found)
            continue
        scatter_row(floats, T, ray, near.t, found)
        scatter_row(integers, PRIM, ray, near.prim, found)
        scatter_row(floats, U, ray, near.u, found)
        scatter_row(floats, V, ray, near.v, found)
