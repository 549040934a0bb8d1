"""Bundles: 16 coherent rays traverse a binary tree together.

Neighbouring camera rays visit nearly the same nodes, so each box and each primitive is
fetched once and tested against all 16. Nodes that no ray of the bundle enters are skipped.
If few shadow rays enter a leaf, they are tested there one by one. The bundle's beam gives
its start nodes and the primitives of a leaf that it may hit (`beams`). Measurements:
docs/performance.md, "Compared with Embree".
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.streams.beams import (
    ROOM,
    Entries,
    begin_bundle,
    find_entries,
    meets_in_leaf,
)
from renderer.accelerators.bvh.wide.one_ray_leaves import (
    better_one_by_one,
    blocked_one_by_one,
)
from renderer.accelerators.bvh.wide.wide_bvh_build import PAIR_CHILD, PAIR_COUNT, PAIR_WORDS
from renderer.accelerators.rays.box_entry import STRETCH, origin_margins, safe_reciprocal
from renderer.accelerators.rays.packets import (
    Packet,
    begin_packet,
    end_packet,
    intersect_packet,
)
from renderer.accelerators.rays.single_ray import is_finite_ray
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane,
    lowest_bit,
    mask_bits,
    maximum,
    minimum,
    splat_f32,
)
from renderer.kernels.lanes.mathematics import multiply_add
from renderer.kernels.lanes.memory import load_one, store_one
from renderer.kernels.lanes.vectors import (
    load3,
    local_f32,
    local_i32,
    local_rows_f32,
    local_rows_i32,
)
from renderer.kernels.records.batch import BOXES, NODES, add_to_packet, note_packet_stack

# a leaf is at most `MAX_DEPTH` = 60 edges deep, and a bundle starts with a list
STACK = 64 + ROOM
_LISTS = 2 * ROOM
BATCH = 1024  # rays that share one beam and its list of start nodes


class PairedBvh(NamedTuple):
    """A binary tree for bundles; see `wide_bvh_build` for the words of a node."""

    floats: NDArray[np.float32]  # (nodes * 8,)
    integers: NDArray[np.int32]  # the same memory
    primitives: Any  # in leaf order


class Bundle(NamedTuple):
    """16 rays, prepared for box tests."""

    inverse: Any  # 1 / direction
    to_lower: Any  # origin moved up by the margin, times inverse
    to_upper: Any  # origin moved down, times inverse


@kernel
def _bundle_of(origin, direction):
    inverse = safe_reciprocal(direction)
    low, high = origin_margins(origin)
    return Bundle(inverse, high * inverse, low * inverse)


@kernel
def _bundle_enters(floats, node, bundle, t):
    """Return the mask of the rays that enter a node's box before t.

    (b - o) / d is computed as b / d - o / d, with o / d computed once. The rounding error
    is that of moving the plane by 2^-23 (|b| + |o|), or less with a fused multiply-add.
    Boxes and origins are padded by 16 times that.
    """
    inverse = bundle.inverse
    x0 = multiply_add(inverse.x, load_one(floats, 0, node), -bundle.to_lower.x)
    y0 = multiply_add(inverse.y, load_one(floats, 0, node + 1), -bundle.to_lower.y)
    z0 = multiply_add(inverse.z, load_one(floats, 0, node + 2), -bundle.to_lower.z)
    x1 = multiply_add(inverse.x, load_one(floats, 0, node + 3), -bundle.to_upper.x)
    y1 = multiply_add(inverse.y, load_one(floats, 0, node + 4), -bundle.to_upper.y)
    z1 = multiply_add(inverse.z, load_one(floats, 0, node + 5), -bundle.to_upper.z)
    enter = maximum(
        maximum(minimum(x0, x1), minimum(y0, y1)),
        maximum(minimum(z0, z1), splat_f32(0.0)),
    )
    leave = minimum(minimum(maximum(x0, x1), maximum(y0, y1)), maximum(z0, z1))
    return enter <= minimum(leave * STRETCH, t)


@kernel
def _signs(direction):
    """Return bits 0, 1, 2: whether the first ray's direction is negative in x, y, z."""
    x = 1 if lane(direction.x, 0) < 0.0 else 0
    y = 2 if lane(direction.y, 0) < 0.0 else 0
    z = 4 if lane(direction.z, 0) < 0.0 else 0
    return np.int64(x | y | z)


@kernel
def trace_bundles(accel, query, first, count, tally):
    """Answer a query for rays first to first + count - 1, in bundles of 16."""
    entries = Entries(
        local_rows_f32(6, _LISTS),
        local_rows_i32(2, _LISTS),
        local_f32(48),
        local_i32(STACK),
    )
    for begin in range(first, first + count, BATCH):
        n = min(first + count - begin, BATCH)
        _trace_batch(accel, query, begin, n, tally, entries)


@kernel
def _trace_batch(accel, query, first, count, tally, entries):
    """Trace the bundles of a batch from the start nodes of its beam."""
    pairs, any_hit, stack = accel.pairs, query.any_hit, entries.stack
    floats, integers, primitives = pairs.floats, pairs.integers, pairs.primitives
    beam, alike, begin, n = find_entries(accel, query, query.ends, first, count, entries)
    if n == 0:
        return
    for i in range(first, first + count, 16):
        left = first + count - i
        origin, direction = load3(query.origin, i), load3(query.direction, i)
        traced = first_lanes(left) & is_finite_ray(origin, direction)
        own, depth = begin_bundle(entries, begin, n, beam, alike, origin, direction, traced)
        add_to_packet(tally, BOXES, i, left, (n + 15) // 16)
        if depth == 0:
            continue
        bundle = _bundle_of(origin, direction)
        signs = _signs(direction)
        packet = begin_packet(query, i, traced)
        while depth > 0 and mask_bits(packet.blocked) != 0xFFFF:
            note_packet_stack(tally, i, left, depth)
            depth -= 1
            node = np.int64(load_one(stack, 0, depth)) * PAIR_WORDS
            add_to_packet(tally, BOXES, i, left, 1)
            enters = _bundle_enters(floats, node, bundle, packet.nearest.t)
            entering = mask_bits(enters & ~packet.blocked)
            if entering == 0:
                continue
            add_to_packet(tally, NODES, i, left, 1)
            child = np.int64(load_one(integers, 0, node + PAIR_CHILD))
            size = np.int64(load_one(integers, 0, node + PAIR_COUNT))
            if size < 0:
                order = -1 - size
                second = ((signs >> (order >> 1)) ^ order) & 1
                store_one(stack, 0, depth, child + 1 - second)
                store_one(stack, 0, depth + 1, child + second)
                depth += 2
                continue
            add_to_packet(tally, BOXES, i, left, 1)
            block = child >> 3
            bits = meets_in_leaf(accel.boxes, block, own) & ((1 << size) - 1)
            if any_hit != 0 and better_one_by_one(entering, bits):
                blocked = blocked_one_by_one(
                    primitives, block, entering, query, i, packet.blocked, tally
                )
                packet = Packet(packet.nearest, blocked)
                continue
            while bits != 0:
                k = child + lowest_bit(bits)
                bits &= bits - 1
                packet = intersect_packet(
                    primitives, k, k + 1, origin, direction, packet, any_hit, tally, i, left
                )
        end_packet(query, i, packet, traced)
