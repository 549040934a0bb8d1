"""Hierarchical grid, first construction: a cell that holds many gets a grid of its own.

A grid over the whole scene, and again one in each of its cells that is worth it, and so
on [Jevans1989]. Worth it is a grid that is expected to cost a ray less than testing the
cell's primitives, by the surface area heuristic [MacDonald1990]: of the rays that meet a
box, a cell inside is met by the share of its surface.

Grids are at most `LEVELS` deep, and take at most 320 bytes for each primitive: 8 cells, 4
grids of 40 bytes, 32 items.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.grids.grid_cells import (
    MOST_COPIES,
    Grids,
    count_in_grid,
    covers_of,
    enclose,
    make_grids,
    pad_of,
    write_grid,
)
from renderer.accelerators.grids.grid_resolution import cell_count
from renderer.accelerators.grids.grid_walk import LEVELS
from renderer.accelerators.grids.hierarchical_grid import HierarchicalGrid
from renderer.kernels.jit import builder_kernel, kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

DENSITY = 2.0  # cells for each primitive: half of what a grid without finer ones has
MANY = 8  # primitives that a cell holds without any thought of a grid
# Costs of entering a grid, and of a step from cell to cell, in primitive tests.
ENTERING = 2.0
STEP = 0.3
# Most cells for each primitive, of all grids together; of items there are `MOST_COPIES`.
MOST_CELLS = 8


def build_nested_grids(extents: Extents, group: PrimitiveGroup) -> HierarchicalGrid:
    """Build a grid of all, and grids in its dense cells."""
    grids = _build(covers_of(extents), pad_of(extents))
    count = extents.lower.shape[1]
    return HierarchicalGrid(grids, np.float32(extents.reach), group(np.arange(count)))


@builder_kernel
def _build(covers, pad):
    """Build breadth first, until nothing is worth a grid or the room is used up."""
    n = len(covers)
    most_grids = MOST_CELLS * n // 2 + 1  # one cell makes no finer grid
    grids = make_grids(most_grids, MOST_CELLS * n, MOST_COPIES * n)
    finer = np.zeros(MOST_CELLS * n, np.int32)  # grid in a cell; 0: none
    level = np.zeros(most_grids, np.int8)
    low, high = np.empty(3), np.empty(3)

    columns = np.arange(n).astype(np.int32)
    enclose(covers, columns, pad, low, high)
    g, ready, used = np.int64(0), np.int64(1), np.int64(0)
    grids.first[g] = 0
    count_in_grid(grids, g, covers, columns, low, high, DENSITY, pad, MOST_COPIES * n)
    used = write_grid(grids, g, covers, columns, used)
    cells = cell_count(grids.resolution[g])
    grids.start[cells] = used
    while g < ready and level[g] + 1 < LEVELS:
        begin = np.int64(grids.first[g])
        for cell in range(begin, begin + cell_count(grids.resolution[g])):
            columns = grids.items[grids.start[cell] : grids.start[cell + 1]]
            m = len(columns)
            density = min(DENSITY, (MOST_CELLS * n - cells) / max(m, 1))
            if m <= MANY or density * m < 2.0 or ready == most_grids:
                continue
            enclose(covers, columns, pad, low, high)
            _clip(grids, g, cell, pad, low, high)
            grids.first[ready] = cells
            most = min(MOST_COPIES * m, MOST_COPIES * n - used)
            total = count_in_grid(
                grids, ready, covers, columns, low, high, density, pad, most
            )
            if total <= most and _cost(grids, ready, total) < m:
                used = write_grid(grids, ready, covers, columns, used)
                cells += cell_count(grids.resolution[ready])
                finer[cell] = ready
                level[ready] = level[g] + 1
                ready += 1
            grids.start[cells] = used  # a grid that was not worth it wrote its counts here
        g += 1
    return _without_replaced(grids, ready, cells, finer, n)


@kernel
def _clip(grids, g, cell, margin, low, high):
    """Shrink a box to a cell of grid g with a margin, outside of which no ray asks."""
    k = cell - grids.first[g]
    for axis in range(3):
        along = k % grids.resolution[g, axis]
        k //= grids.resolution[g, axis]
        edge = np.float64(grids.size[g, axis])
        lower = grids.lower[g, axis] + along * edge
        low[axis] = max(low[axis], lower - margin)
        high[axis] = min(high[axis], lower + edge + margin)


@kernel
def _cost(grids, g, items):
    """Return the expected cost of a ray that meets grid g, in primitive tests."""
    x, y, z = grids.size[g, 0], grids.size[g, 1], grids.size[g, 2]
    a = np.float64(grids.resolution[g, 0])
    b = np.float64(grids.resolution[g, 1])
    c = np.float64(grids.resolution[g, 2])
    whole = a * x * b * y + b * y * c * z + c * z * a * x
    share = (np.float64(x) * y + np.float64(y) * z + np.float64(z) * x) / whole
    return ENTERING + share * (a * b * c * STEP + items)


@builder_kernel
def _without_replaced(grids, ready, cells, finer, n):
    """Return the grids, where a cell that got a grid holds it in place of its items."""
    total = np.int64(0)
    for cell in range(cells):
        total += 1 if finer[cell] > 0 else grids.start[cell + 1] - grids.start[cell]
    start = np.empty(cells + 1, np.int32)
    items = np.empty(total, np.int32)
    k = np.int64(0)
    for cell in range(cells):
        start[cell] = k
        if finer[cell] > 0:
            items[k] = n + finer[cell]
            k += 1
            continue
        for j in range(grids.start[cell], grids.start[cell + 1]):
            items[k] = grids.items[j]
            k += 1
    start[cells] = k
    return Grids(
        grids.lower[:ready].copy(),
        grids.size[:ready].copy(),
        grids.resolution[:ready].copy(),
        grids.first[:ready].copy(),
        start,
        items,
    )
