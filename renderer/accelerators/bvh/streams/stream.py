"""Streams: all rays of a batch go down a tree of eight together, as lists of their places.

At a node the list of the rays that entered it is tested against its children, 16 rays at a
time and without a branch that a single ray decides; those that enter a child are its list
[Barringer2014] [Fuetterling2015]. So it does not matter whether neighbours in the
batch go the same way, only that enough of the batch do, as the rays of a tile after a
bounce: docs/performance.md, "Streams".

What happens at a node and at a leaf is chosen by the class of the tree (`visit`): the tree
of one group of primitives (`ray_streams`), that over instances, whose leaves enter another
tree, and that of an instance's group (`instances.instance_streams`).

A child waits with the place of its parent's list and a mask for each 16 of its rays: the
child's own list is written when its turn comes.
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

# A level's list, and 16 bits for each of eight children and 16 rays of it, in words of 32.
LEVEL = ROW + ROW // 2 + 32
# words of a child
_NODE = 0  # or ~leaf
_LIST = 1  # where its parent's list begins
_LENGTH = 2  # of that list
_MASKS = 3  # where the bits of those that entered the child begin, eight words apart
WAITING_WORDS = 4


class Stream(NamedTuple):
    """The rays of a stream, and which of them go where."""

    rays: StreamRays
    counted: Any  # (ROW,) int32 of each ray: its column in the tally
    lists: Any  # (levels * LEVEL,) int32 places of rays, and masks
    stack: Any  # (children * WAITING_WORDS,) int32 children that wait
    planes: Any  # (48,) float32 of each axis 16 numbers of a node's boxes
    entered: Any  # (16,) int32 whether any ray entered the child


@interface
def visit(tree, query, stream, node, place, m, depth, tally):
    """Let a list of m rays visit a node or ~leaf; return the depth with its children."""


@interface
def descend(tree, query, stream, node, place, m, depth, tally):
    """Let a list of m rays go down a tree from a node or ~leaf on, the nearest child first.

    `depth` children wait on the stack already, and stay there.
    """


@kernel
def descend_tree(tree, query, stream, node, place, m, depth, tally):
    """Implement `descend` for any tree that `visit` knows."""
    floor = depth
    while True:
        depth = visit(tree, query, stream, node, place, m, depth, tally)
        if depth == floor:
            return
        depth -= 1
        node, place, m = pop_child(stream, depth)


@kernel
def list_all(lists, place, n):
    """List places 0 to n - 1."""
    for i in range(0, n, 16):
        store_row(lists, 0, place + i, lane_index() + np.int32(i))


@kernel
def add_nodes(tally, stream, place, m, depth):
    """Count that the rays of a list are tested against a node's children."""
    if tally is None:
        return
    for j in range(place, place + m):
        add_node(tally, stream.counted, stream.lists[j], depth)


@kernel
def push_children(nodes, node, octant, size, stream, place, m, masks, depth):
    """Push the children that any ray of a list entered, the nearest last; return the depth.

    They come in the order for an octant of directions. The list of m rays is at a place,
    and the masks of those that entered a child are behind it.
    """
    word = node * WIDE_WORDS + CHILD
    order = np.int64(load_one(nodes.order, 0, 8 * node + octant))
    for _ in range(size):
        # without a branch: what no ray has entered is written over
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
    """Write the list of the child at a depth; return the child, where, and the length."""
    lists = stream.lists
    at = WAITING_WORDS * depth
    node = np.int64(load_one(stream.stack, 0, at + _NODE))
    parent = np.int64(load_one(stream.stack, 0, at + _LIST))
    length = np.int64(load_one(stream.stack, 0, at + _LENGTH))
    masks = np.int64(load_one(stream.stack, 0, at + _MASKS))
    # behind the masks, and so behind all that waits
    place = (masks + (length + 15) // 16 * 8 + 15) & ~15
    m = np.int64(0)
    for i in range(0, length, 16):
        bits = np.int64(load_one(lists, 0, masks + i // 2))
        append_row(lists, 0, place + m, load_row(lists, 0, parent + i), mask_of(bits))
        m += popcount(bits)
    return node, place, m
