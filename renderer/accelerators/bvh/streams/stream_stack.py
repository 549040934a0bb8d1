"""The children of a wide node that wait to be entered, each by a list of its rays.

What waits is where the parent's list is and a mask for each 16 of its rays: the child's own
list is written when its turn comes.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.wide.wide_bvh_build import CHILD, WIDE_WORDS
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import mask_of, popcount
from renderer.kernels.lanes.memory import append_row, load_one, load_row, store_one

# words of a child
_NODE = 0  # or ~leaf
_LIST = 1  # where its parent's list begins
_LENGTH = 2  # of that list
_MASKS = 3  # where the bits of those that entered the child begin, eight words apart
WAITING_WORDS = 4


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
