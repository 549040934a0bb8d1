"""Which primitives lie in which cells of a grid: a counting sort.

Cells as compressed rows: the items of cell c are items[start[c] : start[c + 1]]. Two
passes over the primitives, one that counts and one that writes, so that nothing is
allocated for a cell. Everything here computes in double precision, with the single
precision corners and cell sizes that the rays will see.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.grids.grid_resolution import (
    cell_count,
    choose_resolution,
    coarsen,
)
from renderer.kernels.jit import builder_kernel, kernel
from renderer.kernels.lanes.local import local_i64
from renderer.plugins.shapes.extents import Extents

# Most cells that hold a primitive, on the average: a grid of more is made coarser. With
# `DENSITY` it bounds the memory: 4 (4 + 32) bytes for each primitive.
MOST_COPIES = 32
# A primitive is registered within so many `pad` of its hull: one is where rays may find it
# by the rounding of its own test, the other is for the rounding of the walk.
MARGINS = 2.0
# Shortest edge of a cell in `pad`: below, the margins are all that it would hold.
SHORTEST = 4.0 * MARGINS
# columns of the array of covers
_LOW, _HIGH, _NORMAL, _NEAR, _FAR = 0, 3, 6, 9, 10
COLUMNS = 11


class Grids(NamedTuple):
    """One grid or many, whose cells and items follow each other in the same order."""

    lower: NDArray[np.float32]  # (grids, 3) corner with the smallest x, y, z
    size: NDArray[np.float32]  # (grids, 3) edges of a cell
    resolution: NDArray[np.int32]  # (grids, 3) number of cells along x, y, z
    first: NDArray[np.int32]  # (grids,) number of the first cell; x runs fastest
    start: NDArray[np.int32]  # (cells + 1,) where the items of a cell begin
    items: NDArray[np.int32]  # what lies in the cells, ascending in each


@builder_kernel
def make_grids(grids, cells, items):
    """Return room for so many; nothing is written yet."""
    return Grids(
        np.empty((grids, 3), np.float32),
        np.empty((grids, 3), np.float32),
        np.empty((grids, 3), np.int32),
        np.empty(grids, np.int32),
        np.empty(cells + 1, np.int32),
        np.empty(items, np.int32),
    )


def pad_of(extents: Extents) -> float:
    """Return `extents.pad`, or a little more than 0 where all is a point at the origin."""
    return max(extents.pad, 1e-30)


def covers_of(extents: Extents) -> NDArray[np.float64]:
    """Return where each primitive may be found, (n, COLUMNS).

    Box, unit normal (0: not flat), and the range of normal . x, all with the margins.
    """
    return _covers(
        extents.lower,
        extents.upper,
        extents.normal,
        extents.points,
        extents.radius,
        MARGINS * pad_of(extents),
    )


@builder_kernel
def _covers(lower, upper, normal, points, radius, margin):
    """Gather what belongs to a primitive in one row."""
    n = lower.shape[1]
    covers = np.empty((n, COLUMNS))
    for k in range(n):
        slack = 0.0
        for axis in range(3):
            covers[k, _LOW + axis] = lower[axis, k] - margin
            covers[k, _HIGH + axis] = upper[axis, k] + margin
            covers[k, _NORMAL + axis] = normal[axis, k]
            slack += (radius[k] + margin) * abs(covers[k, _NORMAL + axis])
        near, far = np.inf, -np.inf
        for corner in range(4):
            height = 0.0
            for axis in range(3):
                height += covers[k, _NORMAL + axis] * points[axis, corner, k]
            near = min(near, height)
            far = max(far, height)
        covers[k, _NEAR] = near - slack
        covers[k, _FAR] = far + slack
    return covers


# -------------------------------------------------------------------------- the two passes


@kernel
def _first_cell(position, lower, size, cells):
    """Return the number along an axis of the cell at a position, or of the nearest one."""
    place = (position - lower) / size
    return np.int64(min(max(place, 0.0), cells - 1.0))


@kernel
def _normal_axis(cover):
    """Return the axis along which the normal is longest."""
    axis = 0 if abs(cover[_NORMAL]) >= abs(cover[_NORMAL + 1]) else 1
    return axis if abs(cover[_NORMAL + axis]) >= abs(cover[_NORMAL + 2]) else 2


@kernel
def _visit(cover, lower, size, resolution, start, item, items):
    """Count an item in each cell that its cover meets, or write it there; return how many.

    Cells are met by the box and, of flat primitives, by the plane: it is solved for the
    axis a along which the normal is longest, row of cells by row of cells, so that a
    triangle across n^3 cells costs n^2 and is in about n^2 of them.
    """
    a = _normal_axis(cover)
    b, c = (a + 1) % 3, (a + 2) % 3
    low = local_i64(3)
    high = local_i64(3)
    for axis in range(3):
        cells = resolution[axis]
        low[axis] = _first_cell(cover[axis], lower[axis], size[axis], cells)
        high[axis] = _first_cell(cover[_HIGH + axis], lower[axis], size[axis], cells)
    strides = local_i64(3)
    strides[0], strides[1] = 1, resolution[0]
    strides[2] = np.int64(resolution[0]) * resolution[1]
    flat = cover[_NORMAL + a] != 0.0 and high[a] > low[a]
    slack = (
        0.5 * abs(cover[_NORMAL + b]) * size[b] + 0.5 * abs(cover[_NORMAL + c]) * size[c]
    )
    visited = np.int64(0)
    for j in range(low[b], high[b] + 1):
        for k in range(low[c], high[c] + 1):
            begin, end = low[a], high[a]
            if flat:
                middle = cover[_NORMAL + b] * (lower[b] + (j + 0.5) * size[b])
                middle += cover[_NORMAL + c] * (lower[c] + (k + 0.5) * size[c])
                near = (cover[_NEAR] - middle - slack) / cover[_NORMAL + a]
                far = (cover[_FAR] - middle + slack) / cover[_NORMAL + a]
                near, far = min(near, far), max(near, far)
                top = lower[a] + np.float64(resolution[a]) * size[a]
                begin = max(begin, _first_cell(near, lower[a], size[a], resolution[a]))
                end = min(end, _first_cell(far, lower[a], size[a], resolution[a]))
                if far < lower[a] or near > top:
                    continue
            cell = begin * strides[a] + j * strides[b] + k * strides[c]
            for _ in range(begin, end + 1):
                if items is None:
                    start[cell] += 1
                else:
                    start[cell] -= 1
                    items[start[cell]] = item
                cell += strides[a]
            visited += max(end + 1 - begin, 0)
    return visited


@kernel
def count_items(covers, columns, lower, size, resolution, start, most):
    """Write to `start` how many items each cell gets; return the sum.

    Parameters
    ----------
    covers
        (n, COLUMNS), where everything may be found.
    columns
        Rows of `covers` that go into the grid, ascending.
    lower, size, resolution
        The grid, (3,) each.
    start
        (cells,) or longer.
    most
        Where the sum exceeds this, counting ends early.
    """
    start[: cell_count(resolution)] = 0
    total = np.int64(0)
    for k in range(len(columns)):
        cover = covers[columns[k]]
        total += _visit(cover, lower, size, resolution, start, columns[k], None)
        if total > most:
            break
    return total


@kernel
def write_items(covers, columns, lower, size, resolution, start, used, items):
    """Turn counts into beginnings, from `used` on, and write the items of each cell.

    The last item comes first: each cell is filled from its end, down to its beginning, and
    its items ascend.
    """
    end = used
    for cell in range(cell_count(resolution)):
        end += start[cell]
        start[cell] = end
    for k in range(len(columns) - 1, -1, -1):
        cover = covers[columns[k]]
        _visit(cover, lower, size, resolution, start, columns[k], items)
    return end


# ------------------------------------------------------------------------------ one grid


@kernel
def enclose(covers, columns, margin, low, high):
    """Write the box around some covers, (3,) each, with a margin."""
    low[:] = np.inf
    high[:] = -np.inf
    for k in range(len(columns)):
        for axis in range(3):
            low[axis] = min(low[axis], covers[columns[k], _LOW + axis] - margin)
            high[axis] = max(high[axis], covers[columns[k], _HIGH + axis] + margin)


@kernel
def frame(grids, g, low, high):
    """Write corner and cell size of grid g, whose resolution is known, over a box."""
    for axis in range(3):
        grids.lower[g, axis] = low[axis]
        edge = high[axis] - np.float64(grids.lower[g, axis])
        grids.size[g, axis] = edge / grids.resolution[g, axis]


@kernel
def count_in_grid(grids, g, covers, columns, low, high, density, pad, most):
    """Choose the resolution of grid g over a box and count its items; return the sum.

    The resolution is halved as long as there are more than `most` items: one cell holds
    each of them once.
    """
    resolution = grids.resolution[g]
    choose_resolution(low, high, density * len(columns), SHORTEST * pad, resolution)
    while True:
        frame(grids, g, low, high)
        start = grids.start[grids.first[g] :]
        total = count_items(
            covers, columns, grids.lower[g], grids.size[g], resolution, start, most
        )
        if total <= most or not coarsen(resolution):
            return total


@kernel
def write_grid(grids, g, covers, columns, used):
    """Write the counted items of grid g from items[used] on; return where they end."""
    start = grids.start[grids.first[g] :]
    lower, size, resolution = grids.lower[g], grids.size[g], grids.resolution[g]
    return write_items(covers, columns, lower, size, resolution, start, used, grids.items)
