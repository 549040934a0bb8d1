"""Grid traversal: the three-dimensional DDA [Amanatides1987].

Of the three planes through which a ray can leave its cell it crosses the nearest, and only
that plane is advanced. The distance of a plane is computed from its index each time, not
accumulated, so the error does not grow with the number of steps: it is a few units in the
last place of `reach`, for which the builders leave a margin. At an edge or a corner the ray
passes through one of the adjacent cells; all of them list the primitives there, since
boxes are grown.

A cell lists primitives and finer grids. A ray that finds a grid in its cell traverses it to
its end or to a hit, and then continues in the outer cell; it keeps its place for each level
of nesting [Jevans1989]. A primitive may be in many cells. Mailboxes remember which ones the
ray has tested, and can be disabled to measure their savings.
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

LEVELS = 6  # most nested grids, including the outermost
_AXES = 3 * LEVELS
_INFINITY = np.float32(np.inf)
_ZERO = np.float32(0.0)


class Grids(NamedTuple):
    """One or many grids, of which number 0 is the outermost; cells and items in order."""

    lower: NDArray[np.float32]  # (grids, 3) corner with the smallest x, y, z
    size: NDArray[np.float32]  # (grids, 3) edges of a cell
    resolution: NDArray[np.int32]  # (grids, 3) number of cells along x, y, z
    first: NDArray[np.int32]  # (grids,) index of the first cell; x runs fastest
    start: NDArray[np.int32]  # (cells + 1,) first item of each cell
    items: NDArray[np.int32]  # ascending in a cell: columns; n + g: grid g, of n primitives
    reach: np.float32  # rays from farther away test all primitives
    mailboxed: int | None  # number of tests that a ray remembers; None: no mailboxes
    primitives: Any  # a group of one kind, in the scene's order


class Walk(NamedTuple):
    """The state of a ray in each grid around it: x, y, z of level k begin at 3 k."""

    origin: Any  # (3,) of the ray
    direction: Any  # (3,)
    inverse: Any  # (3,) 1 / direction; infinite: parallel to the axis's planes
    plane: Any  # (_AXES,) index of the plane through which the ray leaves its cell
    last: Any  # (_AXES,) index of the plane through which it leaves the grid
    stride: Any  # (_AXES,) change of the cell's index per step
    crossing: Any  # (_AXES,) t at `plane`; infinite: never
    cell: Any  # (LEVELS,) index of the cell
    entry: Any  # (LEVELS,) t at which the ray enters the cell


@trace_ray.by(Grids)
@kernel
def _trace_grids(grids, ray, hit, any_hit, tally, i):
    """Return the nearest hit of one ray, or the first hit found."""
    return _trace(grids, grids.mailboxed, ray, hit, any_hit, tally, i)


@kernel
def _trace(grids, mailboxed, ray, hit, any_hit, tally, i):
    """Trace one ray; `mailboxed` is an argument so that Numba types it as None."""
    if mailboxed is None:
        mailboxes = None
    else:
        mailboxes = local_i32(MAILBOXES)
    clear_mailboxes(mailboxes)
    # mailboxes of grids: primitives would soon overwrite them
    entered = local_i32(MAILBOXES)
    clear_mailboxes(entered)
    within = local_i32(LEVELS)  # the grid of each level
    place = local_i32(LEVELS)  # the next item of each level's cell
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
        # in a cell, primitives come before grids
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
        # a cell that begins at a hit's t may hold a smaller id at the same t
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
    """Initialise the walk with the ray, outside of all grids."""
    o, d = ray.origin, ray.direction
    walk.origin[0], walk.origin[1], walk.origin[2] = o.x, o.y, o.z
    walk.direction[0], walk.direction[1], walk.direction[2] = d.x, d.y, d.z
    for axis in range(3):
        walk.inverse[axis] = np.float32(1.0) / walk.direction[axis]


@kernel
def _plane_distance(grids, g, walk, axis, plane):
    """Return t at a plane; not for parallel rays (0 * inf is NaN)."""
    position = grids.lower[g, axis] + np.float32(plane) * grids.size[g, axis]
    return (position - walk.origin[axis]) * walk.inverse[axis]


@kernel
def _entry_to_box(grids, g, walk):
    """Return t where the ray enters a grid's box, at least 0; infinite for a miss."""
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
        # clamp for rounding at the boundary, before conversion to an integer
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

    Each step moves one of three indices towards its end, so there are fewer steps than
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
