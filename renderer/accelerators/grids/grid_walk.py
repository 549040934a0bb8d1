"""A ray's walk through the cells of a grid: the three-dimensional DDA [Amanatides1987].

Of the three planes through which a ray can leave its cell it crosses the nearest; that
plane alone is moved on. A plane's distance is computed from its number each time, never
added up, so that no error grows with the number of steps: a distance is wrong by a few
units in the last place of `reach`, for which the builders leave room.

The ray visits the cells that its inside meets. Through an edge or a corner it goes by way
of one of the cells that only touch it; what lies there is in all of them, since every
primitive is registered with a margin.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs

LEVELS = 6  # most grids that lie in each other, with the outermost
AXES = 3 * LEVELS
INFINITY = np.float32(np.inf)
_ZERO = np.float32(0.0)
_ROUNDED = np.float32(1.000001)


class Walk(NamedTuple):
    """Where a ray is in each grid around it: x, y, z of level k begin at 3 k."""

    origin: Any  # (3,) of the ray
    direction: Any  # (3,)
    inverse: Any  # (3,) 1 / direction; infinite: parallel to the axis's planes
    plane: Any  # (AXES,) number of the plane through which the ray leaves its cell
    last: Any  # (AXES,) number of the plane through which it leaves the grid
    stride: Any  # (AXES,) what a step adds to the cell's number
    crossing: Any  # (AXES,) distance of `plane`; infinite: never
    cell: Any  # (LEVELS,) number of the cell
    entry: Any  # (LEVELS,) distance at which the ray enters it


@kernel
def is_ray(origin, direction):
    """Return whether all is finite and the direction is not 0."""
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    long = fabs(direction.x) + fabs(direction.y) + fabs(direction.z)
    return far < INFINITY and _ZERO < long < INFINITY


@kernel
def is_beyond(reach, origin):
    """Return whether a ray starts farther away than the builders left room for."""
    # the sum is rounded, and a camera at `reach` itself is the rule
    return fabs(origin.x) + fabs(origin.y) + fabs(origin.z) > reach * _ROUNDED


@kernel
def set_out(walk, origin, direction):
    """Write the ray; it is in no grid yet."""
    walk.origin[0], walk.origin[1], walk.origin[2] = origin.x, origin.y, origin.z
    walk.direction[0], walk.direction[1] = direction.x, direction.y
    walk.direction[2] = direction.z
    for axis in range(3):
        walk.inverse[axis] = np.float32(1.0) / walk.direction[axis]


@kernel
def _plane_distance(walk, axis, lower, size, plane):
    """Return where the ray crosses a plane; not for parallel ones (0 * inf is NaN)."""
    position = lower[axis] + np.float32(plane) * size[axis]
    return (position - walk.origin[axis]) * walk.inverse[axis]


@kernel
def _entry_to_box(walk, lower, size, resolution):
    """Return where the ray enters a grid's box, at least 0; infinite if it does not."""
    enter = _ZERO
    leave = INFINITY
    for axis in range(3):
        if fabs(walk.inverse[axis]) < INFINITY:
            a = _plane_distance(walk, axis, lower, size, 0)
            b = _plane_distance(walk, axis, lower, size, resolution[axis])
            enter = max(enter, min(a, b))
            leave = min(leave, max(a, b))
        else:
            above = walk.origin[axis] - lower[axis]
            if not _ZERO <= above <= np.float32(resolution[axis]) * size[axis]:
                return INFINITY
    return enter if enter <= leave else INFINITY


@kernel
def enter_grid(walk, level, lower, size, resolution, first, t_max):
    """Put the ray into its first cell of a grid.

    Parameters
    ----------
    level
        Where in the walk the grid is noted.
    lower, size, resolution
        (3,) each: the grid's corner, the edges of its cells, how many there are.
    first
        Number of its first cell.

    Returns
    -------
    bool
        Whether the ray meets the grid at t_max or before.
    """
    enter = _entry_to_box(walk, lower, size, resolution)
    if not (enter <= t_max and enter < INFINITY):
        return False
    cell = np.int64(first)
    stride = np.int64(1)
    for axis in range(3):
        cells = np.int64(resolution[axis])
        # rounding, or a corner just touched: clamped, and before it becomes an integer
        place = walk.origin[axis] + enter * walk.direction[axis] - lower[axis]
        place = min(max(place / size[axis], _ZERO), np.float32(cells - 1))
        k = np.int64(place)
        cell += k * stride
        at = 3 * level + axis
        parallel = not fabs(walk.inverse[axis]) < INFINITY
        forward = walk.inverse[axis] > _ZERO
        walk.plane[at] = k + 1 if forward else k
        walk.last[at] = cells if forward else 0
        walk.stride[at] = stride if forward else -stride
        walk.crossing[at] = INFINITY
        if not parallel:
            walk.crossing[at] = _plane_distance(walk, axis, lower, size, walk.plane[at])
        stride *= cells
    walk.cell[level] = cell
    walk.entry[level] = enter
    return True


@kernel
def step(walk, level, lower, size):
    """Go on to the next cell; return False if the ray leaves the grid instead.

    Each step moves one of three numbers towards its end, so there are fewer steps than
    cells along the three edges of the grid.
    """
    at = 3 * level
    x, y, z = walk.crossing[at], walk.crossing[at + 1], walk.crossing[at + 2]
    axis = 0 if x < y else 1
    nearest = min(x, y)
    if z < nearest:
        axis, nearest = 2, z
    at += axis
    plane = walk.plane[at]
    if plane == walk.last[at]:
        return False
    plane += 1 if walk.stride[at] > 0 else -1
    walk.plane[at] = plane
    walk.crossing[at] = _plane_distance(walk, axis, lower, size, plane)
    walk.cell[level] += walk.stride[at]
    walk.entry[level] = nearest
    return True
