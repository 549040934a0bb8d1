"""Streams: all rays of a batch traverse a tree of eight together, as lists of indices.

At a node its list of rays is tested against the children, 16 rays at a time and without a
branch per ray. The rays that enter a child form the child's list [Barringer2014]
[Fuetterling2015]. So neighbours in the batch need not go the same way; enough rays of the
whole batch must, as those of a tile after a bounce do: docs/performance.md, "Streams".

The class of the tree selects what happens at a node and at a leaf (`visit`). It is the
tree of one group of primitives (`ray_streams`), the tree over instances, whose leaves enter
another tree, or the tree of an instance's group (`instances.instance_streams`).

A child on the stack stores where its parent's list is, and a mask for each 16 of those
rays. The child's own list is written when it is popped.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.wide.octants import ROW, StreamRays
from renderer.accelerators.bvh.wide.wide_bvh_build import CHILD, WIDE_WORDS
from renderer.accelerators.bvh.wide.wide_rays import add_node
from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import lane_index, mask_of, popcount
from renderer.kernels.lanes.memory import (
    append_row,
    load_one,
    load_row,
    store_one,
    store_row,
)

# Per level: its list, and 16 bits for each of eight children and 16 rays, as int32.
LEVEL = ROW + ROW // 2 + 32
# words of a child on the stack
_NODE = 0  # or ~leaf
_LIST = 1  # index of its parent's list
_LENGTH = 2  # of that list
_MASKS = 3  # index of the masks of rays that entered the child, eight words apart
WAITING_WORDS = 4


class Stream(NamedTuple):
    """The rays of a stream, and the lists of a traversal."""

    rays: StreamRays
    counted: Any  # (ROW,) int32 column of each ray in the tally
    lists: Any  # (levels * LEVEL,) int32 lists of ray indices, and masks
    stack: Any  # (children * WAITING_WORDS,) int32 children to visit
    planes: Any  # (48,) float32 box planes of a node's children, 16 per axis
    entered: Any  # (16,) int32 nonzero if any ray entered the child


@interface
def visit(tree, query, stream, node, place, m, depth, tally):
    """Visit a node or ~leaf with a list of m rays; return the new stack depth."""


@interface
def descend(tree, query, stream, node, place, m, depth, tally):
    """Traverse the subtree of a node or ~leaf with a list of m rays, nearest child first.

    The `depth` children already on the stack stay there.
    """


@kernel
def descend_tree(tree, query, stream, node, place, m, depth, tally):
    """Implement `descend` for all trees that have a `visit`."""
    floor = depth
    while True:
        depth = visit(tree, query, stream, node, place, m, depth, tally)
        if depth == floor:
            return
        depth -= 1
        node, place, m = pop_child(stream, depth)


@kernel
def list_all(lists, place, n):
    """Write the list 0 to n - 1."""
    for i in range(0, n, 16):
        store_row(lists, 0, place + i, lane_index() + np.int32(i))


@kernel
def add_nodes(tally, stream, place, m, depth):
    """Count a test of a list's rays against a node's children."""
    if tally is None:
        return
    for j in range(place, place + m):
        add_node(tally, stream.counted, stream.lists[j], depth)


@kernel
def push_children(nodes, node, octant, size, stream, place, m, masks, depth):
    """Push the children that any ray entered, nearest last; return the new depth.

    The order is that of an octant of directions. The list of m rays is at `place`; its
    masks are at `masks`, behind it.
    """
    word = node * WIDE_WORDS + CHILD
    order = np.int64(load_one(nodes.order, 0, 8 * node + octant))
    for _ in range(size):
        # no branch: a child that no ray entered is overwritten
        k = order & 7
        order >>= 4
        at = WAITING_WORDS * depth
        store_one(stream.stack, 0, at + _NODE, load_one(nodes.integers, 0, word + k))
        store_one(stream.stack, 0, at + _LIST, place)
        store_one(stream.stack, 0, at + _LENGTH, m)
        store_one(stream.stack, 0, at + _MASKS, masks + k)
        depth += 1 if load_one(stream.entered, 0, k) != 0 else 0
    return depth


@kernel
def pop_child(stream, depth):
    """Write the list of the child at a depth; return the child, its list and its length."""
    lists = stream.lists
    at = WAITING_WORDS * depth
    node = np.int64(load_one(stream.stack, 0, at + _NODE))
    parent = np.int64(load_one(stream.stack, 0, at + _LIST))
    length = np.int64(load_one(stream.stack, 0, at + _LENGTH))
    masks = np.int64(load_one(stream.stack, 0, at + _MASKS))
    # behind the masks, and so behind all lists in use
    place = (masks + (length + 15) // 16 * 8 + 15) & ~15
    m = np.int64(0)
    for i in range(0, length, 16):
        bits = np.int64(load_one(lists, 0, masks + i // 2))
        append_row(lists, 0, place + m, load_row(lists, 0, parent + i), mask_of(bits))
        m += popcount(bits)
    return node, place, m
