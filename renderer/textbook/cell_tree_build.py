"""Build a tree of cells: choose a plane, distribute the primitives, repeat.

A rule (a record, such as `kd_tree.KdRule`) chooses the planes. The rest is the same for all
trees: a stack of cells to be cut, and the list of primitives in each.

The build is single-threaded, not recursive and deterministic. For n primitives the leaves
hold at most (1 + EXTRA) n references, and no leaf is deeper than `MAX_DEPTH`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import builder_kernel, interface, kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.cell_tree import MARGIN, MAX_DEPTH, CellTree

LEAF = 4  # cells with up to this many primitives are not cut
# Limit of what cuts may add per primitive: a primitive in both halves, or an empty half,
# counts as one. A cell's remaining budget is divided among its halves by their size, so
# that no part of the scene uses up that of another.
EXTRA = 8


class Places(NamedTuple):
    """Bounds of n primitives: their boxes and hulls, grown by `MARGIN` pads."""

    boxes: NDArray[np.float32]  # (n, 6) lower x y z, upper x y z
    points: NDArray[np.float32]  # (n, 4, 3) corners of the hull
    growth: NDArray[np.float32]  # (n,) by which the hull extends beyond its corners
    normal: NDArray[np.float32]  # (n, 3) unit, of the plane of a flat primitive; or 0


@interface
def choose_plane(rule, places, columns, cell, depth, plane):
    """Write the plane (4,) that cuts a cell; return False for a leaf.

    Parameters
    ----------
    rule
        A record whose class selects the implementation.
    places : Places
        Of all primitives.
    columns
        Indices of the primitives that reach into the cell.
    cell
        (6,) its box, if all planes above it are axis-aligned.
    depth
        Edges from the root.
    plane
        Output: a unit normal and an offset.
    """


def build_cell_tree(extents: Extents, group: PrimitiveGroup, rule: Any, cell: Any) -> Any:
    """Build by a rule from a root cell (6,) that holds all; None: their common bounds."""
    margin = np.float32(MARGIN * extents.pad)
    places = Places(
        np.concatenate((extents.lower - margin, extents.upper + margin)).T.copy(),
        np.ascontiguousarray(extents.points.transpose(2, 1, 0)),
        (extents.radius + margin).astype(np.float32),
        np.ascontiguousarray(extents.normal.T),
    )
    bounds = bounds_of(extents)
    cell = bounds if cell is None else cell
    nodes, plane, child, first, end, items = _build(rule, places, cell)
    rows = (array[:nodes].copy() for array in (plane, child, first, end))
    group_of_all = group(np.arange(len(places.growth)))
    return CellTree(*rows, items, bounds, np.float32(extents.reach), group_of_all)


def bounds_of(extents: Extents) -> NDArray[np.float32]:
    """Return the box (6,) of all primitives, grown by `MARGIN` times `extents.pad`.

    The pad covers the rounding of rays.
    """
    margin = MARGIN * extents.pad
    low, high = extents.lower.min(axis=1) - margin, extents.upper.max(axis=1) + margin
    return np.concatenate((low, high)).astype(np.float32)


@builder_kernel
def _build(rule, places, root):
    """Return the number of nodes, the arrays of a `CellTree`, and its items."""
    n = len(places.growth)
    most = (1 + EXTRA) * n
    plane = np.zeros((2 * most, 4), np.float32)
    child = np.zeros(2 * most, np.int32)
    first, end = np.zeros(2 * most, np.int32), np.zeros(2 * most, np.int32)
    items = np.empty(most, np.int32)
    sides, behind = np.empty(n, np.int8), np.empty(n, np.int32)
    # the primitives of the stacked cells, in stack order
    waiting = np.empty(most, np.int32)
    waiting[:n] = np.arange(n)
    stack = np.empty((MAX_DEPTH + 2, 5), np.int64)  # node, begin, end, depth, budget
    cells = np.empty((MAX_DEPTH + 2, 6), np.float32)
    stack[0] = (0, 0, n, 0, EXTRA * n)
    cells[0] = root
    top, nodes, used = 1, 1, 0
    while top > 0:
        top -= 1
        node, begin, stop, depth, room = stack[top]
        columns, size, cell = waiting[begin:stop], stop - begin, cells[top]
        # cut, or make a leaf
        cut = depth < MAX_DEPTH
        cut = cut and choose_plane(rule, places, columns, cell, depth, plane[node])
        if cut:
            back, front = _classify(places, columns, plane[node], sides)
            added = max(back, 1) + max(front, 1) - size
            cut = added <= room
        if not cut:
            plane[node] = 0.0
            first[node], end[node] = used, used + size
            items[used : used + size] = columns
            used += size
            continue
        # the half behind is on top of the stack and is taken first
        _share_out(waiting, begin, stop, sides, behind)
        middle = begin + front
        for_back = (room - added) * back // max(back + front, 1)
        child[node] = nodes
        stack[top] = (nodes + 1, begin, middle, depth + 1, room - added - for_back)
        stack[top + 1] = (nodes, middle, middle + back, depth + 1, for_back)
        cells[top + 1] = cell
        for axis in range(3):
            if plane[node, axis] == 1.0:
                cells[top, axis] = cells[top + 1, axis + 3] = plane[node, 3]
        top += 2
        nodes += 2
    return nodes, plane, child, first, end, items[:used].copy()


@kernel
def set_plane(plane, axis, position):
    """Write an axis-aligned plane."""
    plane[:] = np.float32(0.0)
    plane[axis] = np.float32(1.0)
    plane[3] = position


@kernel
def span(places, k, x, y, z):
    """Return the range of normal . p over the points p of primitive k, in float64.

    Box and hull each enclose the primitive, so the intersection of their ranges is used.
    """
    middle = half = np.float64(0.0)
    for axis in range(3):
        a = x if axis == 0 else (y if axis == 1 else z)
        low, high = np.float64(places.boxes[k, axis]), np.float64(places.boxes[k, axis + 3])
        middle += a * 0.5 * (low + high)
        half += abs(a) * 0.5 * (high - low)
    low, high = np.inf, -np.inf
    for j in range(4):
        p = places.points[k, j]
        s = x * np.float64(p[0]) + y * np.float64(p[1]) + z * np.float64(p[2])
        low, high = min(low, s), max(high, s)
    growth = np.float64(places.growth[k])
    return max(low - growth, middle - half), min(high + growth, middle + half)


@kernel
def side_of(places, k, plane):
    """Return -1 for a primitive behind a plane, 1 for one in front, 0 for both sides."""
    x, y, z = np.float64(plane[0]), np.float64(plane[1]), np.float64(plane[2])
    low, high = span(places, k, x, y, z)
    if high < plane[3]:
        return -1
    return 1 if low > plane[3] else 0


@kernel
def _classify(places, columns, plane, sides):
    """Write the side of each primitive; return how many reach behind and in front."""
    back = front = 0
    for i in range(len(columns)):
        side = side_of(places, columns[i], plane)
        sides[i] = side
        back += side <= 0
        front += side >= 0
    return back, front


@kernel
def _share_out(waiting, begin, stop, sides, behind):
    """Replace a cell's list by that of its front half, then that of its back half."""
    to_back, to_front = 0, begin
    for i in range(begin, stop):
        k = waiting[i]
        if sides[i - begin] <= 0:
            behind[to_back] = k
            to_back += 1
        if sides[i - begin] >= 0:
            waiting[to_front] = k
            to_front += 1
    for i in range(to_back):
        waiting[to_front + i] = behind[i]
