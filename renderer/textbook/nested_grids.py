"""Hierarchical grid, first construction: a dense cell gets a grid of its own.

One grid covers the scene, and recursively each of its cells gets a grid if that pays
[Jevans1989]. A grid pays if its expected cost for a ray is less than testing the cell's
primitives, by the surface area heuristic [MacDonald1990]: a ray that hits a box hits a cell
inside it with a probability of the ratio of their surface areas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.grid_walk import LEVELS, Grids
from renderer.textbook.uniform_grid import (
    MOST_COPIES,
    Grid,
    boxes_of,
    enclose,
    join_grids,
    make_grid,
    pad_of,
)

DENSITY = 2.0  # cells per primitive: half of the density of a single grid
MANY = 8  # a cell with up to this many primitives gets no grid
# Costs of entering a grid, and of a step from cell to cell, in primitive tests.
ENTERING = 2.0
STEP = 0.3
MOST_CELLS = 8  # per primitive, of all grids together; of items, `MOST_COPIES`


def build_nested_grids(extents: Extents, group: PrimitiveGroup) -> Grids:
    """Build a grid of all primitives, and grids in its dense cells, breadth first."""
    boxes, pad = boxes_of(extents), pad_of(extents)
    n = len(boxes)
    columns, box = np.arange(n, dtype=np.int32), enclose(boxes, pad)
    grids = [make_grid(boxes, columns, box, DENSITY, pad, MOST_COPIES * n)]
    levels = [1]
    inner: list[dict[int, int]] = [{}]  # of each grid: cell -> the grid in it
    # cells and items that may still be added
    room = MOST_CELLS * n - grids[0].resolution.prod()
    most = MOST_COPIES * n - len(grids[0].items)
    for g, grid in enumerate(grids):  # `grids` grows during the loop
        if levels[g] == LEVELS:
            break
        for cell in np.flatnonzero(np.diff(grid.start) > MANY).tolist():
            columns = grid.items[grid.start[cell] : grid.start[cell + 1]]
            m = len(columns)
            density = min(DENSITY, room / m)
            if density * m < 2.0:
                break
            box = _clipped(enclose(boxes[columns], pad), grid, cell, pad)
            finer = make_grid(boxes, columns, box, density, pad, min(MOST_COPIES * m, most))
            if len(finer.items) <= most and _cost(finer) < m:
                inner[g][cell] = len(grids)
                grids.append(finer)
                levels.append(levels[g] + 1)
                inner.append({})
                room -= finer.resolution.prod()
                most -= len(finer.items)
    return join_grids(
        [_with_inner(grid, held, n) for grid, held in zip(grids, inner, strict=True)],
        extents,
        group,
    )


def _clipped(
    box: NDArray[np.float64], grid: Grid, cell: int, margin: float
) -> NDArray[np.float64]:
    """Return the part of a box in a cell with a margin; rays look for it only there."""
    place = np.unravel_index(cell, grid.resolution, order="F")
    low = grid.lower + np.array(place) * grid.size.astype(np.float64)
    high = low + grid.size + margin
    return np.concatenate((np.maximum(box[:3], low - margin), np.minimum(box[3:], high)))


def _cost(grid: Grid) -> float:
    """Return the expected cost of a ray that hits a grid, in primitive tests."""
    cell, whole = grid.size.astype(np.float64), grid.size * grid.resolution
    share = (cell * np.roll(cell, 1)).sum() / (whole * np.roll(whole, 1)).sum()
    return float(ENTERING + share * (STEP * grid.resolution.prod() + len(grid.items)))


def _with_inner(grid: Grid, inner: dict[int, int], n: int) -> Grid:
    """Return a grid in whose cells finer grids replace the items listed there."""
    if not inner:
        return grid
    cells = np.array(list(inner))
    cell = np.repeat(np.arange(len(grid.start) - 1), np.diff(grid.start))
    kept = np.ones(len(grid.start) - 1, bool)
    kept[cells] = False
    kept = kept[cell]
    items = np.concatenate((grid.items[kept], n + np.array(list(inner.values()))))
    cell = np.concatenate((cell[kept], cells))
    counts = np.bincount(cell, minlength=len(grid.start) - 1)
    start = np.append(0, np.cumsum(counts))
    order = np.argsort(cell, kind="stable")
    return grid._replace(start=start, items=items[order].astype(np.int32))
