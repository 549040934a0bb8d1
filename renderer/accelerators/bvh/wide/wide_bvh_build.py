"""Convert a binary tree to the two traversal formats: pairs, and nodes of eight.

`pack_pairs` stores siblings together, 64 bytes per pair: one cache line. `collapse` merges
up to eight descendants into one node of 128 bytes: two lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.wide.wide_bvh_collapse import (
    ROOMS,
    choose_children,
    write_costs,
)
from renderer.kernels.jit import entry_kernel, kernel
from renderer.kernels.lanes.vectors import local_f64, local_i32
from renderer.plugins.shapes.blocks import aligned_bytes

# words of a node in a pair
PAIR_CHILD = 6  # inner: first of two adjacent nodes; leaf: first primitive
PAIR_COUNT = 7  # leaf: primitives; inner: -1 - order, see `_order_of`
PAIR_WORDS = 8

# words of a wide node, and then its bytes
ORIGIN = 0  # 3 floats: the coordinate of byte 0
SCALE = 3  # 3 floats: the unit of a byte, a power of two
CHILD = 6  # 8 integers: 0 empty, > 0 a node, < 0 the block ~child
WIDE_WORDS = 32
BOX_BYTES = 56  # byte offset; per axis 8 lower bounds, 8 upper bounds, 8 lower bounds again
AXIS_BYTES = 24
WIDE_BYTES = 128

# Padding in units of a byte; it covers the rounding in this file. The traversal's own is
# at most half a unit in the last place of a coordinate, an eighth of a byte's unit, and is
# covered by the 32 of `primitive_bounds`.
_SLACK = 2.0**-10
_LARGEST_BYTE = 250.0  # room for the rounding of the origin


def pack_pairs(bounds: Any, child: Any, count: Any) -> NDArray[np.uint8]:
    """Return a binary tree's nodes in pairs; the root is alone in the first pair.

    Parameters
    ----------
    bounds, child, count
        As in `BvhTree`; siblings are adjacent, the first pair is nodes 1 and 2.
    """
    memory = aligned_bytes(4 * PAIR_WORDS * (len(count) + 1))
    _pack(bounds, child, count, memory.view(np.float32), memory.view(np.int32))
    return memory


@entry_kernel
def _pack(bounds, child, count, floats, integers):
    for node in range(len(count)):
        to = PAIR_WORDS * _in_pairs(node)
        for j in range(6):
            floats[to + j] = bounds[node, j]
        if count[node] > 0:
            integers[to + PAIR_CHILD] = child[node]
            integers[to + PAIR_COUNT] = count[node]
        else:
            integers[to + PAIR_CHILD] = child[node] + 1
            integers[to + PAIR_COUNT] = -1 - _order_of(bounds, child[node])


@kernel
def _in_pairs(node):
    """Return the index among the pairs of a node of the binary tree."""
    return node + 1 if node > 0 else 0


@kernel
def _order_of(bounds, first):
    """Return 2 * the axis that separates two siblings + whether the second comes first."""
    best = -1.0
    order = 0
    for axis in range(3):
        a = np.float64(bounds[first, axis]) + np.float64(bounds[first, axis + 3])
        b = np.float64(bounds[first + 1, axis]) + np.float64(bounds[first + 1, axis + 3])
        if abs(b - a) > best:
            best = abs(b - a)
            order = 2 * axis + (1 if b < a else 0)
    return order


def collapse(
    bounds: Any, child: Any, count: Any
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Return the nodes of eight, and the index of each child among the pairs.

    A leaf's `child` must be eight times its block number. `wide_bvh_collapse` chooses which
    binary nodes become children.
    """
    most = max(1, np.count_nonzero(count))
    memory = aligned_bytes(WIDE_BYTES * most)
    waiting = np.zeros((len(count) + 1, 2), np.int32)  # rows of (binary node, wide node)
    pair_of = np.zeros(8 * most, np.int32)
    nodes = _collapse(
        bounds,
        child,
        count,
        memory.view(np.float32),
        memory.view(np.int32),
        memory,
        waiting,
        pair_of,
        np.empty((len(count), ROOMS), np.float32),
    )
    return memory[: WIDE_BYTES * nodes], pair_of[: 8 * nodes]


@entry_kernel
def _collapse(bounds, child, count, floats, integers, octets, waiting, pair_of, costs):
    write_costs(bounds, child, count, costs)
    top = 1
    nodes = 1
    members = local_i32(8)
    while top > 0:
        top -= 1
        node = waiting[top, 0]
        wide = waiting[top, 1]
        size = choose_children(child, count, node, costs, members)
        _quantise(bounds, node, members, size, floats, octets, wide)
        for k in range(size):
            m = members[k]
            place = WIDE_WORDS * wide + CHILD + k
            pair_of[8 * wide + k] = _in_pairs(m)
            if count[m] > 0:
                integers[place] = ~(child[m] >> 3)
                continue
            integers[place] = nodes
            waiting[top, 0] = m
            waiting[top, 1] = nodes
            top += 1
            nodes += 1
    return nodes


@kernel
def _quantise(bounds, node, members, size, floats, octets, wide):
    """Write the children's boxes as multiples of a power of two, rounded outwards."""
    for axis in range(3):
        low = np.float64(bounds[node, axis])
        high = np.float64(bounds[node, axis + 3])
        # flat nodes: float32 must be able to add the unit to the coordinate
        least = max(abs(low), abs(high)) * 2.0**-21 + 1e-30
        unit = 2.0 ** np.ceil(np.log2(max((high - low) / _LARGEST_BYTE, least)))
        origin = np.float64(np.float32(low - unit))
        floats[WIDE_WORDS * wide + ORIGIN + axis] = origin
        floats[WIDE_WORDS * wide + SCALE + axis] = unit
        place = WIDE_BYTES * wide + BOX_BYTES + AXIS_BYTES * axis
        for k in range(size):
            lower = (np.float64(bounds[members[k], axis]) - origin) / unit
            upper = (np.float64(bounds[members[k], axis + 3]) - origin) / unit
            octets[place + k] = int(np.floor(lower - _SLACK))
            octets[place + 8 + k] = int(np.ceil(upper + _SLACK))
            octets[place + 16 + k] = octets[place + k]


def far_to_near(floats: Any, integers: Any, octets: Any) -> NDArray[np.int32]:
    """Return the order of each node's children for each octant of directions, (8 n,).

    Four bits per child, the farthest first, by their centres along the octant's diagonal.
    """
    order = np.zeros(8 * len(integers) // WIDE_WORDS, np.int32)
    _far_to_near(floats, integers, octets, order)
    return order


@entry_kernel
def _far_to_near(floats, integers, octets, found):
    distance = local_f64(8)
    for place in range(len(found)):
        node, octant = place // 8, place % 8
        order = np.int64(0)
        for k in range(8):
            if integers[WIDE_WORDS * node + CHILD + k] == 0:
                continue
            distance[k] = _along_diagonal(floats, octets, node, k, octant)
            rank = 0  # farther children of lower k keep their places
            for j in range(k):
                rank += 1 if distance[(order >> (4 * j)) & 7] >= distance[k] else 0
            low = (1 << (4 * rank)) - 1
            order = (order & low) | (k << (4 * rank)) | ((order & ~low) << 4)
        found[place] = order


@kernel
def _along_diagonal(floats, octets, node, k, octant):
    """Return a child's centre along the diagonal of an octant."""
    distance = 0.0
    for axis in range(3):
        octet = WIDE_BYTES * node + BOX_BYTES + AXIS_BYTES * axis + k
        unit = np.float64(floats[WIDE_WORDS * node + SCALE + axis])
        along = (np.float64(octets[octet]) + np.float64(octets[octet + 8])) * unit
        distance += -along if (octant >> axis) & 1 else along
    return distance
