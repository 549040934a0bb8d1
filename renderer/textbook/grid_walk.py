"""A ray's walk through the cells of grids: the three-dimensional DDA [Amanatides1987].

Of the three planes through which a ray can leave its cell it crosses the nearest; that
plane alone is moved on. A plane's distance is computed from its number each time, never
added up, so that no error grows with the number of steps: a distance is wrong by a few
units in the last place of `reach`, for which the builders leave room. Through an edge or a
corner the ray goes by way of one of the cells that only touch it; what lies there is listed
in all of them, since boxes are grown.

A cell lists primitives and finer grids. A ray that finds a grid in its cell walks through
it to its end or to a hit, and then goes on in the cell where it was: for each level of
nesting it keeps its place [Jevans1989]. A primitive lies in many cells; mailboxes remember
which ones the ray has tested, and can be left out to show what they save.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs
from renderer.kernels.lanes.vectors import local_f32, local_i32
from renderer.kernels.records.batch import BOXES, NODES, add_to, note_stack
from renderer.textbook.one_ray import (
    MAILBOXES,
    already_tested,
    clear_mailboxes,
    test_primitive,
    trace_ray,
)

LEVELS = 6  # most grids that lie in each other, with the outermost
_AXES = 3 * LEVELS
_INFINITY = np.float32(np.inf)
_ZERO = np.float32(0.0)


class Grids(NamedTuple):
    """One grid or many, of which number 0 is the outermost; cells and items in order."""

    lower: NDArray[np.float32]  # (grids, 3) corner with the smallest x, y, z
    size: NDArray[np.float32]  # (grids, 3) edges of a cell
    resolution: NDArray[np.int32]  # (grids, 3) number of cells along x, y, z
    first: NDArray[np.int32]  # (grids,) number of the first cell; x runs fastest
    start: NDArray[np.int32]  # (cells + 1,) where the items of a cell begin
    items: NDArray[np.int32]  # ascending in a cell; of n primitives: columns; n + g: grid g
    reach: np.float32  # rays from beyond test all primitives
    mailboxed: int | None  # how many tests a ray remembers; None: it has no mailboxes
    primitives: Any  # a group of one kind, in the scene's order


class Walk(NamedTuple):
    """Where a ray is in each grid around it: x, y, z of level k begin at 3 k."""

    origin: Any  # (3,) of the ray
    direction: Any  # (3,)
    inverse: Any  # (3,) 1 / direction; infinite: parallel to the axis's planes
    plane: Any  # (_AXES,) number of the plane through which the ray leaves its cell
    last: Any  # (_AXES,) number of the plane through which it leaves the grid
    stride: Any  # (_AXES,) what a step adds to the cell's number
    crossing: Any  # (_AXES,) distance of `plane`; infinite: never
    cell: Any  # (LEVELS,) number of the cell
    entry: Any  # (LEVELS,) distance at which the ray enters it


@trace_ray.by(Grids)
@kernel
def _trace_grids(grids, ray, hit, any_hit, tally, i):
    """Return the nearest hit of one ray, or the first hit found."""
    return _trace(grids, grids.mailboxed, ray, hit, any_hit, tally, i)


@kernel
def _trace(grids, mailboxed, ray, hit, any_hit, tally, i):
    """Trace one ray; Numba sees that an argument is None, of a field it would not."""
    if mailboxed is None:
        mailboxes = None
    else:
        mailboxes = local_i32(MAILBOXES)
    clear_mailboxes(mailboxes)
    # of grids: the primitives in a grid would soon overwrite it among their own
    entered = local_i32(MAILBOXES)
    clear_mailboxes(entered)
    within = local_i32(LEVELS)  # the grid
    place = local_i32(LEVELS)  # the next item of the cell
    walk = Walk(
        local_f32(3),
        local_f32(3),
        local_f32(3),
        local_i32(_AXES),
        local_i32(_AXES),
        local_i32(_AXES),
        local_f32(_AXES),
        local_i32(LEVELS),
        local_f32(LEVELS),
    )
    _set_out(walk, ray)
    start, items, count = grids.start, grids.items, grids.primitives.count
    level, g = np.int64(-1), np.int64(0)  # in no grid; the one to enter, or -1
    while True:
        if g >= 0 and _enter_grid(grids, g, walk, level + 1, hit.t, tally, i):
            level += 1
            note_stack(tally, i, level + 1)
            within[level], place[level] = g, start[walk.cell[level]]
        if level < 0:
            return hit
        # the primitives of a cell come before its grids
        k, end = np.int64(place[level]), np.int64(start[walk.cell[level] + 1])
        while k < end and items[k] < count:
            if not already_tested(mailboxes, items[k], tally, i):
                hit = test_primitive(grids.primitives, items[k], ray, hit, tally, i)
            k += 1
        if any_hit != 0 and hit.prim >= 0:
            return hit
        place[level] = k + 1
        g = np.int64(-1)
        if k < end:
            if not already_tested(entered, items[k], None, i):
                g = np.int64(items[k]) - count
        # a cell that begins at a hit's t may hold one of smaller id at the same t
        elif (
            _step(grids, np.int64(within[level]), walk, level)
            and walk.entry[level] <= hit.t
        ):
            add_to(tally, NODES, i, 1)
            place[level] = start[walk.cell[level]]
        else:
            level -= 1


@kernel
def _set_out(walk, ray):
    """Write the ray; it is in no grid yet."""
    o, d = ray.origin, ray.direction
    walk.origin[0], walk.origin[1], walk.origin[2] = o.x, o.y, o.z
    walk.direction[0], walk.direction[1], walk.direction[2] = d.x, d.y, d.z
    for axis in range(3):
        walk.inverse[axis] = np.float32(1.0) / walk.direction[axis]


@kernel
def _plane_distance(grids, g, walk, axis, plane):
    """Return where the ray crosses a plane; not for parallel ones (0 * inf is NaN)."""
    position = grids.lower[g, axis] + np.float32(plane) * grids.size[g, axis]
    return (position - walk.origin[axis]) * walk.inverse[axis]


@kernel
def _entry_to_box(grids, g, walk):
    """Return where the ray enters a grid's box, at least 0; infinite if it does not."""
    enter, leave = _ZERO, _INFINITY
    for axis in range(3):
        cells = grids.resolution[g, axis]
        if fabs(walk.inverse[axis]) < _INFINITY:
            a = _plane_distance(grids, g, walk, axis, 0)
            b = _plane_distance(grids, g, walk, axis, cells)
            enter = max(enter, min(a, b))
            leave = min(leave, max(a, b))
        else:
            above = walk.origin[axis] - grids.lower[g, axis]
            if not _ZERO <= above <= np.float32(cells) * grids.size[g, axis]:
                return _INFINITY
    return enter if enter <= leave else _INFINITY


@kernel
def _enter_grid(grids, g, walk, level, t_max, tally, i):
    """Put the ray into its first cell of grid g; return False if it misses the grid."""
    add_to(tally, BOXES, i, 1)
    enter = _entry_to_box(grids, g, walk)
    if not (enter <= t_max and enter < _INFINITY):
        return False
    add_to(tally, NODES, i, 1)
    cell, stride = np.int64(grids.first[g]), np.int64(1)
    for axis in range(3):
        cells = np.int64(grids.resolution[g, axis])
        # rounding, or a corner just touched: clamped, and before it becomes an integer
        place = walk.origin[axis] + enter * walk.direction[axis] - grids.lower[g, axis]
        place = min(max(place / grids.size[g, axis], _ZERO), np.float32(cells - 1))
        k = np.int64(place)
        cell += k * stride
        at = 3 * level + axis
        forward = walk.inverse[axis] > _ZERO
        walk.plane[at] = k + 1 if forward else k
        walk.last[at] = cells if forward else 0
        walk.stride[at] = stride if forward else -stride
        walk.crossing[at] = _INFINITY
        if fabs(walk.inverse[axis]) < _INFINITY:
            walk.crossing[at] = _plane_distance(grids, g, walk, axis, walk.plane[at])
        stride *= cells
    walk.cell[level] = cell
    walk.entry[level] = enter
    return True


@kernel
def _step(grids, g, walk, level):
    """Go on to the next cell; return False if the ray leaves the grid instead.

    Each step moves one of three numbers towards its end, so there are fewer steps than
    cells along the three edges of the grid.
    """
    at = 3 * level
    x, y, z = walk.crossing[at], walk.crossing[at + 1], walk.crossing[at + 2]
    axis, nearest = (0, x) if x < y else (1, y)
    if z < nearest:
        axis, nearest = 2, z
    at += axis
    plane = walk.plane[at]
    if plane == walk.last[at]:
        return False
    plane += 1 if walk.stride[at] > 0 else -1
    walk.plane[at] = plane
    walk.crossing[at] = _plane_distance(grids, g, walk, axis, plane)
    walk.cell[level] += walk.stride[at]
    walk.entry[level] = nearest
    return True
