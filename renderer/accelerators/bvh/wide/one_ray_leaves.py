"""Leaves for single rays: all eight primitives of a leaf are tested against one ray.

If 16 rays are at a leaf, they can also be tested together against one primitive after the
other. The SIMD width decides which is cheaper. With AVX2 eight lanes are one vector and 16
are two, so one ray against eight primitives takes half the time of 16 rays against one
(docs/performance.md, "Leaves and nodes of eight").
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.wide.octants import ENDED, T
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    lane,
    lane_index,
    lowest_bit,
    mask_bits,
    popcount,
    select,
    smallest,
)
from renderer.kernels.lanes.memory import load_eight, load_one, store_one
from renderer.kernels.lanes.vectors import column3
from renderer.kernels.records.batch import PRIMITIVES, add_to
from renderer.plugins.shapes.blocks import WIDTH, primitives_in
from renderer.plugins.shapes.primitives import hit_primitive

NEVER = np.int32(0x7FFFFFFF)  # above the bits of every float, and above every id
# This many tests of one ray against eight take as long as one of 16 rays against a
# primitive: measured with AVX2, and with AVX-512, whose width suggests 1.
_EIGHTS_A_TEST = 2


class BlockHit(NamedTuple):
    """The nearest hit of one ray among the primitives of a block."""

    t: Any
    prim: Any
    u: Any
    v: Any


@kernel
def held(blocks, block):
    """Return the number of primitives in a block."""
    return popcount(mask_bits(load_eight(blocks.id, 0, WIDTH * block) >= 0))


@kernel
def count_block(tally, blocks, block, i):
    """Count a test of ray i against the primitives of a block."""
    if tally is not None:
        add_to(tally, PRIMITIVES, i, held(blocks, block))


@kernel
def hit_block(blocks, block, origin, direction, t_max):
    """Intersect one ray with the eight primitives of a block."""
    return hit_primitive(blocks, primitives_in(blocks, block), origin, direction, t_max)


@kernel
def nearest_in_block(blocks, block, x):
    """Return the nearest hit of `hit_block`; at equal t the least id wins."""
    # non-negative floats sort as their bits do
    bits = select(x.hit, as_i32(x.t), NEVER)
    t_bits = smallest(bits)
    ids = select(bits == t_bits, load_eight(blocks.id, 0, WIDTH * block), NEVER)
    prim = smallest(ids)
    k = lowest_bit(mask_bits(ids == prim))
    return BlockHit(as_f32(t_bits), prim, lane(x.u, k), lane(x.v, k))


@kernel
def intersect_block(blocks, block, query, rows, ray, tally):
    """Test a ray, by its index in the rows, against the primitives of a leaf."""
    i = np.int64(load_one(rows.number, 0, ray))
    count_block(tally, blocks, block, i)
    origin, direction = column3(rows.for_leaves, 0, ray), column3(rows.for_leaves, 4, ray)
    t_max = load_one(rows.for_boxes, T, ray)
    x = hit_block(blocks, block, origin, direction, t_max)
    if mask_bits(x.hit) == 0:
        return
    if query.any_hit != 0:
        store_one(query.prim, 0, i, 1)
        store_one(rows.for_boxes, T, ray, ENDED)
        return
    near = nearest_in_block(blocks, block, x)
    prim = load_one(query.prim, 0, i)
    if near.t < t_max or prim < 0 or near.prim < prim:
        store_one(rows.for_boxes, T, ray, near.t)
        store_one(query.ends, 0, i, near.t)
        store_one(query.prim, 0, i, near.prim)
        store_one(query.u, 0, i, near.u)
        store_one(query.v, 0, i, near.v)


# ------------------------------------------------------------------------------- bundles


@kernel
def better_one_by_one(live, bits):
    """Return whether one test per live ray is cheaper than one per set bit of `bits`."""
    return popcount(live) <= _EIGHTS_A_TEST * popcount(bits)


@kernel
def blocked_one_by_one(blocks, block, live, query, i, blocked, tally):
    """Test the rays of the bits `live` one by one; return the mask of blocked rays."""
    while live != 0:
        j = lowest_bit(live)
        live &= live - 1
        count_block(tally, blocks, block, i + j)
        origin = column3(query.origin, 0, i + j)
        direction = column3(query.direction, 0, i + j)
        t_max = load_one(query.ends, 0, i + j)
        x = hit_block(blocks, block, origin, direction, t_max)
        if mask_bits(x.hit) != 0:
            blocked = blocked | (lane_index() == np.int32(j))
    return blocked
