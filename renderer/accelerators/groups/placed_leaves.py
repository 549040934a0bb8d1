"""What the rays of a list meet in a leaf of a group: together, or ray by ray."""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.octants import ENDED
from renderer.accelerators.groups.placed_rays import (
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
    as_f32,
    as_i32,
    first_lanes,
    lane,
    lowest_bit,
    mask_bits,
    select,
    smallest,
    splat_f32,
)
from renderer.kernels.lanes.memory import (
    gather_row,
    load_eight,
    load_one,
    load_row,
    scatter_row,
    store_one,
)
from renderer.kernels.lanes.vectors import column3, gather_rows3
from renderer.kinds.shapes.blocks import WIDTH, primitives_in
from renderer.kinds.shapes.primitives import hit_primitive

_NEVER = np.int32(0x7FFFFFFF)  # above the bits of every float, and every id
# words of a leaf of primitives
FIRST = 0  # its first primitive
END = 1
KIND = 2  # which of the kinds of primitives, by their place in `Instances`
TOGETHER = 3  # leaves from this one on that are tested together, one of each kind
LEAF_WORDS = 4


@kernel
def meet_leaf(instances, leaf, any_will_do, rows, lists, place, m):
    """Test the rays of a list against the primitives of a leaf, which are of one kind."""
    first = np.int64(load_one(instances.leaves, 0, leaf + FIRST))
    end = np.int64(load_one(instances.leaves, 0, leaf + END))
    kind = load_one(instances.leaves, 0, leaf + KIND)
    if kind == 0:
        _meet(instances.triangles, first, end, any_will_do, rows, lists, place, m)
    elif kind == 1:
        _meet(instances.rectangles, first, end, any_will_do, rows, lists, place, m)
    elif kind == 2:
        _meet(instances.disks, first, end, any_will_do, rows, lists, place, m)
    elif kind == 3:
        _meet(instances.spheres, first, end, any_will_do, rows, lists, place, m)
    elif kind == 4:
        _meet(instances.cylinders, first, end, any_will_do, rows, lists, place, m)
    elif kind == 5:
        _meet_together(instances.implicits, first, end, any_will_do, rows, lists, place, m)
    else:
        _meet_together(instances.sdf_cells, first, end, any_will_do, rows, lists, place, m)


@kernel
def _meet(primitives, first, end, any_will_do, rows, lists, place, m):
    """Test the rays of a list against primitives in blocks of eight."""
    if primitives is None:
        return
    if m > SHORT:
        _meet_together(primitives, first, end, any_will_do, rows, lists, place, m)
        return
    for j in range(m):
        ray = np.int64(load_one(lists, 0, place + j))
        for block in range(first >> 3, (end + 7) >> 3):
            _meet_block(primitives, block, any_will_do, rows, ray)


@kernel
def _meet_block(blocks, block, any_will_do, rows, ray):
    """Test one ray against eight primitives."""
    floats, integers = rows.floats, rows.integers
    t_before = load_one(floats, T, ray)
    origin, direction = column3(floats, ORIGIN, ray), column3(floats, DIRECTION, ray)
    x = hit_primitive(blocks, primitives_in(blocks, block), origin, direction, t_before)
    if mask_bits(x.hit) == 0:
        return
    if any_will_do != 0:
        store_one(floats, T, ray, ENDED)
        return
    # the least t, then the least id among those
    bits = select(x.hit, as_i32(x.t), _NEVER)
    t_bits = smallest(bits)
    ids = select(bits == t_bits, load_eight(blocks.id, 0, WIDTH * block), _NEVER)
    prim = smallest(ids)
    t = as_f32(t_bits)
    prim_before = load_one(integers, PRIM, ray)
    if t < t_before or prim_before < 0 or prim < prim_before:
        k = lowest_bit(mask_bits(ids == prim))
        store_one(floats, T, ray, t)
        store_one(integers, PRIM, ray, prim)
        store_one(floats, U, ray, lane(x.u, k))
        store_one(floats, V, ray, lane(x.v, k))


@kernel
def _meet_together(primitives, first, end, any_will_do, rows, lists, place, m):
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
        if any_will_do != 0:
            scatter_row(floats, T, ray, splat_f32(ENDED), found)
            continue
        scatter_row(floats, T, ray, near.t, found)
        scatter_row(integers, PRIM, ray, near.prim, found)
        scatter_row(floats, U, ray, near.u, found)
        scatter_row(floats, V, ray, near.v, found)
