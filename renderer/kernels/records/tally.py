"""Counting what an accelerator does for each ray; costs nothing when nobody counts.

Every traversal has a parameter `tally`. Given None, Numba compiles it without the counting;
given an array, it compiles a twin that counts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel

# rows of the array
NODES = 0  # tree nodes, cells or voxels visited
BOXES = 1  # tests of the ray against a box or a splitting plane
PRIMITIVES = 2  # tests of the ray against a primitive
SAVED = 3  # primitive tests that mailboxing saved
STACK = 4  # largest number of nodes that waited on the stack
ROWS = 5
NAMES = ("nodes", "box tests", "primitive tests", "mailbox saves", "stack depth")


def make_tally(rays: int) -> NDArray[np.int32]:
    """Return counters at zero, (ROWS, rays), with room for 16 rays more."""
    return np.zeros((ROWS, rays + 16), np.int32)


@kernel
def add_to(tally, row, i, amount):
    """Add to a counter of ray i."""
    if tally is None:
        return
    tally[row, i] += amount


@kernel
def add_to_packet(tally, row, i, count, amount):
    """Add to a counter of each of the first `count` of the 16 rays from i on."""
    if tally is None:
        return
    for j in range(i, i + min(count, 16)):
        tally[row, j] += amount


@kernel
def note_stack(tally, i, depth):
    """Note how many nodes wait for ray i."""
    if tally is None:
        return
    tally[STACK, i] = max(tally[STACK, i], depth)


@kernel
def note_packet_stack(tally, i, count, depth):
    """Note how many nodes wait for the first `count` of the 16 rays from i on."""
    if tally is None:
        return
    for j in range(i, i + min(count, 16)):
        tally[STACK, j] = max(tally[STACK, j], depth)
