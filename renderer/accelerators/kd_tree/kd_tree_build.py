"""Building a kd-tree: cells are split from the root down, then bad splits are retracted.

One thread, without recursion; always the same tree. Bounds, whatever is built over n
primitives: at most `ROOM` n references (an empty cell counts as one), so fewer than
2 `ROOM` n nodes; and the depth of `depth_limit`, 8 + 1.3 log2 n [Pharr2023] or `MAX_DEPTH`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.kd_tree.kd_tree_nodes import (
    LEAF,
    MAX_DEPTH,
    KdNodes,
    laid_out,
    retract,
    room_for,
)
from renderer.accelerators.kd_tree.kd_tree_split import (
    BINS,
    CHEAPEST,
    MEDIAN,
    MIDDLE,
    NONE,
    cheapest_split,
    leaf_cost,
    longest_axis,
    median_plane,
    middle_plane,
    share_above,
    share_below,
)
from renderer.accelerators.references import (
    Hulls,
    copy_reference,
    fits,
    lies_above,
    lies_below,
)
from renderer.kernels.jit import entry_kernel, kernel

# References for each primitive. Each cell may use the room that is its share by the number
# of its references, so that no part of the scene takes the room of another.
ROOM = 6
LEAF_SIZE = 8  # of the rules that do not weigh costs
# Splits on the way to a cell that seemed to improve nothing. Some do so later: halves of
# diagonals all cross the first plane.
BAD_SPLITS = 3


def depth_limit(n: int, rule: int) -> int:
    """Return the most edges from the root to a leaf of a tree over n primitives.

    Halving cells takes levels by how much sizes differ, not by numbers: with the formula of
    the others, a ball in a stadium took 1369 primitive tests a ray instead of 24.
    """
    return MAX_DEPTH if rule == MIDDLE else min(MAX_DEPTH, int(8 + 1.3 * math.log2(n)))


def build_kd_arrays(
    boxes: NDArray[np.float32], hulls: Hulls, bounds: NDArray[np.float32], rule: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Build a tree.

    Parameters
    ----------
    boxes : (n, 6)
        The primitives' boxes.
    hulls : Hulls
        The same primitives' hulls.
    bounds : (6,)
        The root's cell, which holds all boxes.
    rule : int
        Where to split: MIDDLE, MEDIAN or CHEAPEST.

    Returns
    -------
    (nodes, 2), (leaves + 1,), (items,)
        Nodes as in `KdTree`, where the items of each leaf begin, and items.
    """
    n, levels = len(boxes), depth_limit(len(boxes), rule)
    work = _Work(
        held=np.empty((ROOM + 1) * n, np.int32),
        parts=np.empty(((ROOM + 1) * n, 6), np.float32),
        starts=np.empty(n, np.float32),
        ends=np.empty(n, np.float32),
        counts=np.empty((2, BINS), np.int64),
        waiting=np.empty((levels + 2, 5), np.int64),
        cells=np.empty((levels + 2, 6), np.float32),
        rooms=np.empty(levels + 2, np.float64),
    )
    work.held[:n], work.parts[:n] = np.arange(n), boxes
    work.waiting[0] = (0, 0, n, 0, 0)
    work.cells[0] = bounds
    work.rooms[0] = ROOM * n
    nodes, items = room_for(2 * ROOM * n), np.empty(ROOM * n, np.int32)
    made, used = _split_cells(hulls, rule, levels, work, nodes, items)
    nodes = KdNodes(*(row[:made] for row in nodes))
    retract(nodes, rule, np.empty(made, np.float64))
    return laid_out(nodes, items[:used], n)


class _Work(NamedTuple):
    """What waits to be split, and room for the search of a split."""

    # references of waiting cells, those of the next cell last
    held: NDArray[np.int32]
    parts: NDArray[np.float32]  # (references, 6) boxes of what is in the cell
    starts: NDArray[np.float32]
    ends: NDArray[np.float32]
    counts: NDArray[np.int64]
    # one waiting cell for each level
    waiting: NDArray[np.int64]  # (levels, 5) node, begin, end, depth, bad splits above
    cells: NDArray[np.float32]  # (levels, 6)
    rooms: NDArray[np.float64]


@entry_kernel
def _split_cells(hulls, rule, max_depth, work, nodes, items):
    """Write all nodes, and the items of the leaves; return how many of each."""
    held, parts, cells, rooms = work.held, work.parts, work.cells, work.rooms
    waiting = work.waiting
    nodes.share[0] = 1.0
    made, used = np.int64(1), np.int64(0)
    top = np.int64(1)
    while top > 0:
        top -= 1
        node, begin, end = waiting[top, 0], waiting[top, 1], waiting[top, 2]
        depth, bad = waiting[top, 3], waiting[top, 4]
        cell, room = cells[top], rooms[top]
        nodes.count[node] = end - begin
        nodes.begin[node] = used

        # choose: leaf or split
        axis, plane, good = NONE, np.float32(0.0), False
        if depth < max_depth and rule == CHEAPEST:
            cost, axis, plane = cheapest_split(
                parts, begin, end, cell, work.starts, work.ends, work.counts
            )
            good = cost < leaf_cost(end - begin)
        elif depth < max_depth and end - begin > LEAF_SIZE:
            axis, plane, good = _plain_split(rule, parts, begin, end, cell, work.starts)
        bad += 0 if good else 1
        if bad > BAD_SPLITS or not _has_room(parts, begin, end, axis, plane, room):
            axis = NONE
        if axis == NONE:
            nodes.axis[node] = LEAF
            for r in range(begin, end):
                items[used] = held[r]
                used += 1
            nodes.end[node] = used
            continue

        above, below = _share_out(held, parts, begin, end, hulls, axis, plane)
        nodes.axis[node] = axis
        nodes.plane[node] = plane
        nodes.child[node] = made
        nodes.share[made] = share_below(cell, axis, plane)
        nodes.share[made + 1] = share_above(cell, axis, plane)
        middle = begin + above
        _wait(waiting, top, made + 1, begin, middle, depth + 1, bad)
        _wait(waiting, top + 1, made, middle, middle + below, depth + 1, bad)
        for j in range(6):
            cells[top + 1, j] = cell[j]
        cells[top + 1, axis + 3] = plane
        cell[axis] = plane
        weight = max(above, 1) / (max(above, 1) + max(below, 1))
        rooms[top] = room * weight
        rooms[top + 1] = room - room * weight
        top += 2
        made += 2
    return made, used


@kernel
def _wait(waiting, place, node, begin, end, depth, bad):
    """Note a cell that waits; a tuple would compile for half a second."""
    waiting[place, 0] = node
    waiting[place, 1] = begin
    waiting[place, 2] = end
    waiting[place, 3] = depth
    waiting[place, 4] = bad


@kernel
def _plain_split(rule, parts, begin, end, cell, scratch):
    """Return (axis, plane, good) in the middle or at the median of the cell's longest axis.

    Or of a shorter axis, where only that leaves something out on one side. Along where the
    primitives spread most, the median took half again as many primitive tests on a bumpy
    sphere.
    """
    first = (NONE, np.float32(0.0), False)
    for rank in range(3):
        axis = longest_axis(cell, rank)
        if rule == MEDIAN:
            plane = median_plane(parts, begin, end, axis, scratch)
        else:
            plane = middle_plane(cell, axis)
        if not cell[axis] < plane < cell[axis + 3]:
            continue
        below, above = _numbers(parts, begin, end, axis, plane)
        if min(below, above) < end - begin:
            return axis, plane, True
        if first[0] == NONE:
            first = (axis, plane, False)
    return first


@kernel
def _numbers(parts, begin, end, axis, plane):
    """Return how many references reach below and above a plane."""
    below = above = 0
    for r in range(begin, end):
        if lies_below(parts[r], axis, plane):
            below += 1
        if lies_above(parts[r], axis, plane):
            above += 1
    return below, above


@kernel
def _has_room(parts, begin, end, axis, plane, room):
    """Return whether there is a split, and room for its references."""
    if axis == NONE:
        return False
    below, above = _numbers(parts, begin, end, axis, plane)
    return max(below, 1) + max(above, 1) <= room


@kernel
def _share_out(held, parts, begin, end, hulls, axis, plane):
    """Replace the references of a cell by those of its parts; return (above, below).

    Those above stay in place, from `begin` on, and those below come after them.
    """
    stay, extra = begin, end
    for r in range(begin, end):
        k = held[r]
        below = lies_below(parts[r], axis, plane)
        above = lies_above(parts[r], axis, plane)
        if below:
            copy_reference(held, parts, r, extra)
            if above:
                parts[extra, axis + 3] = plane
                below = fits(hulls, k, parts[extra], axis)
            extra += 1 if below else 0
        if above:
            copy_reference(held, parts, r, stay)
            if parts[stay, axis] < plane:
                parts[stay, axis] = plane
                above = fits(hulls, k, parts[stay], axis)
            stay += 1 if above else 0
    for r in range(extra - end):
        copy_reference(held, parts, end + r, stay + r)
    return stay - begin, extra - end
