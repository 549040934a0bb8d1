"""Building an octree: cells are cut into eight from the root down, where that helps.

One thread, without recursion; always the same tree. Bounds, whatever is built over n
primitives: at most `ROOM` n references and cuts together, and a depth of `MAX_DEPTH`.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.references import (
    copy_reference,
    fits,
    lies_above,
    lies_below,
)
from renderer.kernels.jit import builder_kernel, kernel

MAX_DEPTH = 16  # edges from the root to the deepest leaf; sizes traversal stacks
LEAF_SIZE = 8  # cells with more primitives are cut
# References and cuts for each primitive. Each cell may use the room that is its share by
# the number of its references, so that no part of the scene takes the room of another.
ROOM = 8
# A cut that multiplies references by more than this, or leaves all of them in two cells,
# does not help: around a vertex where more than LEAF_SIZE triangles meet, such cuts would
# go on down to the limit of depth.
MOST_COPIES = 2
# But it may just have met a wall, which it copies into four cells, and cut some of that in
# eight. On the way to a cell, one of those that hold many may be cut like that.
WALL_COPIES = 5
BAD_CUTS = 1
MANY = 64
EMPTY = -1  # link to leaf 0, which all empty cells share


@builder_kernel
def build_octree_arrays(boxes, hulls, cube):
    """Build a tree over boxes (n, 6) from a root cell (6,).

    Returns centre, link, first and items as in `Octree`.
    """
    n = len(boxes)
    most = ROOM * n
    centre = np.empty((most + 1, 3), np.float32)
    link = np.empty(8 * most + 1, np.int32)
    first = np.zeros(most + 2, np.int32)
    items = np.empty(most, np.int32)
    blocks, leaves, used = 0, 1, 0

    # references of waiting cells, those of the next cell last
    held = np.empty((ROOM + 1) * n, np.int32)
    parts = np.empty(((ROOM + 1) * n, 6), np.float32)
    held[:n] = np.arange(n)
    parts[:n] = boxes
    counts = np.empty(8, np.int64)

    # waiting cells: node, begin, end, depth, bad cuts above
    waiting = np.empty((7 * MAX_DEPTH + 8, 5), np.int64)
    cells = np.empty((7 * MAX_DEPTH + 8, 6), np.float32)
    rooms = np.empty(7 * MAX_DEPTH + 8, np.float64)
    waiting[0] = (0, 0, n, 0, 0)
    cells[0] = cube
    rooms[0] = np.float64(most)
    top = 1
    while top > 0:
        top -= 1
        node, begin, end, depth, bad = waiting[top]
        room = rooms[top]
        size = end - begin

        # choose: leaf or eight children
        total = -1
        if size > LEAF_SIZE and depth < MAX_DEPTH and _middle(cells[top], centre[blocks]):
            middle, limit = centre[blocks], min(WALL_COPIES * size, int(room) - 1)
            total = _share_out(held, parts, begin, end, hulls, middle, counts, limit)
            if total > MOST_COPIES * size or _number_of(size, counts) > 1:
                bad += 1
                if bad > BAD_CUTS or size <= MANY:
                    total = -1
        if total < 0:
            link[node] = -1 - leaves
            first[leaves] = used
            for r in range(begin, end):
                items[used] = held[r]
                used += 1
            leaves += 1
            first[leaves] = used
            continue

        for r in range(total):
            copy_reference(held, parts, end + r, begin + r)
        link[node] = blocks
        cell = cells[top].copy()
        at = begin
        for octant in range(7, -1, -1):
            child = 1 + 8 * blocks + octant
            count = counts[octant]
            if count == 0:
                link[child] = EMPTY
                continue
            waiting[top] = (child, at, at + count, depth + 1, bad)
            rooms[top] = (room - 1.0) * (count / total)
            for axis in range(3):
                above = (octant >> axis) & 1
                cells[top, axis] = centre[blocks, axis] if above else cell[axis]
                cells[top, axis + 3] = cell[axis + 3] if above else centre[blocks, axis]
            at += count
            top += 1
        blocks += 1
    return (
        centre[:blocks].copy(),
        link[: 1 + 8 * blocks].copy(),
        first[: leaves + 1].copy(),
        items[:used].copy(),
    )


@kernel
def _middle(cell, centre):
    """Write the centre of a cell; return whether it is strictly inside."""
    inside = True
    for axis in range(3):
        middle = np.float32(0.5) * cell[axis] + np.float32(0.5) * cell[axis + 3]
        centre[axis] = middle
        inside = inside and cell[axis] < middle < cell[axis + 3]
    return inside


@kernel
def _share_out(held, parts, begin, end, hulls, centre, counts, limit):
    """Write the references of a cell's octants after its own; return how many.

    Octant 7 comes first, octant 0 last. Returns -1 if there are more than `limit`.
    """
    extra = end
    for octant in range(7, -1, -1):
        start = extra
        for r in range(begin, end):
            if not _lies_in(parts[r], octant, centre):
                continue
            if extra - end >= limit:
                return -1
            copy_reference(held, parts, r, extra)
            if _cut(hulls, held[r], parts[extra], octant, centre):
                extra += 1
        counts[octant] = extra - start
    return extra - end


@kernel
def _number_of(value, counts):
    """Return how many counts have a value."""
    found = 0
    for count in counts:
        found += 1 if count == value else 0
    return found


@kernel
def _lies_in(box, octant, centre):
    """Return whether a box reaches into an octant."""
    for axis in range(3):
        if (octant >> axis) & 1:
            if not lies_above(box, axis, centre[axis]):
                return False
        elif not lies_below(box, axis, centre[axis]):
            return False
    return True


@kernel
def _cut(hulls, k, box, octant, centre):
    """Shrink the box of primitive k to an octant; return whether anything is left."""
    for axis in range(3):
        if box[axis] < centre[axis] < box[axis + 3]:
            box[axis + 3 - 3 * ((octant >> axis) & 1)] = centre[axis]
            if not fits(hulls, k, box, axis):
                return False
    return True
