"""Uniform grid: equal cells, each with the list of primitives in it.

The number of cells is proportional to that of the primitives [Cleary1988]. A primitive is
listed in each cell that its box overlaps. All cells are equal: of a teapot in a stadium,
one cell holds it. Nested grids solve this (`nested_grids.py`, `clustered_grids.py`);
they use the same record and the same traversal (`grid_walk.py`).

The lists of all cells are stored in sequence in one array. There are two passes over the
primitives, one that counts and one that writes, and no allocation per cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.vectors import local_i64
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.grid_walk import Grids
from renderer.textbook.one_ray import MAILBOXES

# Cells per primitive. A density of one makes the cube root of n cells along each edge, as
# in the lecture; the best density is a constant [Cleary1988]. Cells visited and primitives
# tested per ray from afar, mesh of 81,920 triangles: 15 and 47 at a density of 1, 24 and 24
# at 4, 31 and 18 at 8; a step costs a third to half of a test.
DENSITY = 4.0
# Most cells per primitive on average; a grid with more is made coarser.
MOST_COPIES = 32
# Boxes are enlarged by this many `pad`: one for the rounding of a primitive's own test, one
# for the rounding of the traversal.
MARGIN = 2.0
SHORTEST = 4.0 * MARGIN  # edge of a cell in `pad`; a shorter one would hold margins only


class Grid(NamedTuple):
    """One grid of equal cells; x runs fastest in cell indices."""

    lower: NDArray[np.float32]  # (3,) corner with the smallest x, y, z
    size: NDArray[np.float32]  # (3,) edges of a cell
    resolution: NDArray[np.int64]  # (3,) number of cells along x, y, z
    start: NDArray[np.int64]  # (cells + 1,) cell c lists items[start[c] : start[c + 1]]
    items: NDArray[np.int32]  # ascending in each cell


def build_uniform_grid(
    extents: Extents,
    group: PrimitiveGroup,
    mailboxed: int | None = MAILBOXES,
    density: float = DENSITY,
) -> Grids:
    """Sort the primitives into the cells of one grid.

    Parameters
    ----------
    extents, group
        As for every builder.
    mailboxed
        None for rays without mailboxes: they test a primitive again in each cell.
    density
        Cells per primitive; fewer if a primitive would be in more than `MOST_COPIES` cells
        on average.
    """
    boxes, pad = boxes_of(extents), pad_of(extents)
    most = int(max(MOST_COPIES, density) * len(boxes))
    columns = np.arange(len(boxes), dtype=np.int32)
    grid = make_grid(boxes, columns, enclose(boxes, pad), density, pad, most)
    return join_grids([grid], extents, group, mailboxed)


def pad_of(extents: Extents) -> float:
    """Return `extents.pad`, or slightly more than 0 if all is a point at the origin."""
    return max(extents.pad, 1e-30)


def boxes_of(extents: Extents) -> NDArray[np.float64]:
    """Return the primitives' boxes with the margin, (n, 6): lower x y z, upper x y z."""
    margin = MARGIN * pad_of(extents)
    low, high = extents.lower.astype(np.float64), extents.upper.astype(np.float64)
    return np.concatenate((low - margin, high + margin)).T.copy()


def enclose(boxes: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Return the box (6,) around some boxes, with a margin."""
    low, high = boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)
    return np.concatenate((low - margin, high + margin))


def choose_resolution(
    edges: NDArray[np.float64], wanted: float, shortest: float
) -> NDArray[np.int64]:
    """Return the numbers of cells along x, y, z of a box: at most `wanted` in all.

    Cells are as close to cubes as possible. An axis too short for one such cube gets one
    cell, and the others share the rest: in a flat scene the square root of `wanted` along
    each edge. No cell gets edges below `shortest`.
    """
    shares = np.ones(3, bool)
    per_length = 0.0
    while shares.any():
        per_length = (wanted / edges[shares].prod()) ** (1.0 / shares.sum())
        least = np.where(shares, edges, np.inf).argmin()
        if edges[least] * per_length >= 1.0:
            break
        shares[least] = False
    cells = np.minimum(edges * per_length, edges / shortest)
    return np.where(shares, np.maximum(cells, 1.0), 1.0).astype(np.int64)


def make_grid(
    boxes: NDArray[np.float64],
    columns: NDArray[np.int32],
    box: NDArray[np.float64],
    density: float,
    pad: float,
    most: int,
) -> Grid:
    """Return a grid over a box that lists some of the boxes, by their rows.

    The resolution is halved while there are more than `most` items, down to one cell, which
    lists each of them once.
    """
    lower = box[:3].astype(np.float32)
    edges = box[3:] - lower
    most = max(most, len(columns))  # or counting would stop before the last one
    resolution = choose_resolution(edges, density * len(columns), SHORTEST * pad)
    while True:
        size = (edges / resolution).astype(np.float32)
        counts = np.zeros(resolution.prod(), np.int64)
        total = _visit_cells(boxes, columns, lower, size, resolution, counts, most, None)
        if total <= most or resolution.prod() == 1:
            break
        resolution = (resolution + 1) // 2
    start = np.append(0, np.cumsum(counts))
    items, place = np.empty(start[-1], np.int32), start[:-1].copy()
    _visit_cells(boxes, columns, lower, size, resolution, place, 1 << 60, items)
    return Grid(lower, size, resolution, start, items)


@entry_kernel
def _visit_cells(boxes, columns, lower, size, resolution, place, most, items):
    """Count in `place` the items of each cell, or write items[place]; return the sum.

    Counting stops when the sum exceeds `most`. It is in double precision, with the same
    corner and cell size as in the traversal.
    """
    total = np.int64(0)
    low, high = local_i64(3), local_i64(3)
    for k in columns:
        for axis in range(3):
            last = resolution[axis] - 1.0
            a = (boxes[k, axis] - lower[axis]) / size[axis]
            b = (boxes[k, axis + 3] - lower[axis]) / size[axis]
            low[axis] = np.int64(min(max(a, 0.0), last))
            high[axis] = np.int64(min(max(b, 0.0), last))
        for z in range(low[2], high[2] + 1):
            for y in range(low[1], high[1] + 1):
                row = (z * resolution[1] + y) * resolution[0]
                for cell in range(row + low[0], row + high[0] + 1):
                    if items is not None:
                        items[place[cell]] = k
                    place[cell] += 1
                total += high[0] + 1 - low[0]
        if total > most:
            break
    return total


def join_grids(
    grids: Sequence[Grid],
    extents: Extents,
    group: PrimitiveGroup,
    mailboxed: int | None = MAILBOXES,
) -> Grids:
    """Return the record of grids whose items are primitives, or n + g for grid g."""
    cells = np.cumsum([0, *(len(grid.start) - 1 for grid in grids)])
    used = np.cumsum([0, *(len(grid.items) for grid in grids)])
    starts = [grid.start[:-1] + before for grid, before in zip(grids, used, strict=False)]
    return Grids(
        np.array([grid.lower for grid in grids]),
        np.array([grid.size for grid in grids]),
        np.array([grid.resolution for grid in grids], np.int32),
        cells[:-1].astype(np.int32),
        np.concatenate([*starts, used[-1:]]).astype(np.int32),
        np.concatenate([grid.items for grid in grids]),
        np.float32(extents.reach),
        mailboxed,
        group(np.arange(extents.lower.shape[1])),
    )
