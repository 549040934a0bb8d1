"""What each place sees of an environment, so that light samples go to windows.

Indoors most directions to a sky are blocked. A grid of cells holds, for each cell, the top
of the pyramid that chooses directions (`hierarchical_warp`) with its sums weighted by how
much of each part of the sky points nearby see. A share of all samples ignores that, so that
what was not seen adds noise, but never a bias.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel, table_columns
from renderer.kernels.lanes.functions import select, splat_f32, splat_i32, to_i32
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.plugins.sampling.hierarchical_warp import Warp, descend, pyramid

UNSEEN = 0.05
"""The share of samples that ignore what is seen: a ratio of densities is at least this."""
MOST_PARTS = 512
"""Of the sky, of which each cell knows how much is seen; a part is 11 degrees wide then."""

Floats = NDArray[np.float64]


@table_columns("blocks")
class SkyByPlace(NamedTuple):
    """Row 0 of the tables is for places that nothing is known of."""

    levels: int  # of the pyramid that each cell has itself; 0: there are no cells
    low: NDArray[np.float32]  # (3,) corner of the grid, world
    cells: NDArray[np.float32]  # (3,) per unit of length
    size: NDArray[np.int32]  # (3,) cells along x, y, z
    row: NDArray[np.int32]  # (x y z,) of each cell, x first
    blocks: NDArray[np.float32]  # (4, rows n) the first n blocks of `Warp.blocks`, by row
    count: int  # n
    inverse: NDArray[np.float32]  # (parts,) 1 / what each part of the sky gives
    across: int  # parts side by side
    # (rows,) irradiance relative to that of a whole sky of the same mean, at most 1
    share: NDArray[np.float32]


class Cells(NamedTuple):
    """Where cells are."""

    low: Floats  # (3,) corner of the grid, world
    width: float  # of a cell
    size: NDArray[np.int64]  # (3,) cells along x, y, z
    row: NDArray[np.int64]  # (x y z,) row of each cell, from 1 on; 0: none


NOWHERE = SkyByPlace(
    0,
    np.zeros(3, np.float32),
    np.zeros(3, np.float32),
    np.zeros(3, np.int32),
    np.zeros(1, np.int32),
    by_columns(np.zeros((4, 0), np.float32)),
    0,
    np.ones(1, np.float32),
    1,
    np.ones(1, np.float32),
)
"""All places see the whole sky."""


def parts_of_sky(warp: Warp) -> tuple[int, Floats]:
    """Return the levels above the parts of the sky, and what each part gives.

    Returns
    -------
    levels : int
        0 if the image has a single patch.
    gives : ndarray of shape (rows, columns)
        Their sum is 1. Parts beyond the edge of the image give 0.
    """
    ends = [*warp.start[1:], warp.blocks.shape[1]]
    levels = 0
    while levels < len(ends) and 4 * (ends[levels] - warp.start[levels]) <= MOST_PARTS:
        levels += 1
    if levels == 0 or ends[0] == 0:
        return 0, np.ones((1, 1))
    last = levels - 1
    across = int(warp.across[last])
    blocks = warp.blocks[:, warp.start[last] : ends[last]].astype(np.float64)
    parts = blocks.reshape(2, 2, -1, across).transpose(2, 0, 3, 1)
    gives = parts.reshape(-1, 2 * across)
    return levels, gives / gives.sum()


def sky_by_place(warp: Warp, cells: Cells, seen: Floats) -> SkyByPlace:
    """Return the tables.

    Parameters
    ----------
    seen : ndarray of shape (rows of cells, rows, columns)
        How much of each part of the sky is seen in a cell, in [0, 1].
    """
    levels, gives = parts_of_sky(warp)
    lit = gives * seen
    total = lit.sum(axis=(1, 2), keepdims=True)
    known = total > 0.0
    lit = np.where(known, lit / np.where(known, total, 1.0), gives)
    lit = np.concatenate([gives[None], (1.0 - UNSEEN) * lit + UNSEEN * gives])
    inverse = np.divide(1.0, gives, out=np.zeros_like(gives), where=gives > 0.0)
    blocks = [level.reshape(4, len(lit), -1) for level in pyramid(lit.astype(np.float32))]
    table = np.concatenate(blocks, axis=2)
    return SkyByPlace(
        levels,
        cells.low.astype(np.float32),
        np.full(3, 1.0 / cells.width, np.float32),
        cells.size.astype(np.int32),
        cells.row.astype(np.int32),
        by_columns(table.reshape(4, -1)),
        table.shape[2],
        np.ascontiguousarray(inverse.ravel(), np.float32),
        gives.shape[1],
        np.append(1.0, np.minimum(2.0 * total.ravel(), 1.0)).astype(np.float32),
    )


@kernel
def place_at(places, position, mask):
    """Return the rows of the cells that positions are in."""
    low, cells, size = places.low, places.cells, places.size
    x = (position.x - low[0]) * cells[0]
    y = (position.y - low[1]) * cells[1]
    z = (position.z - low[2]) * cells[2]
    zero = splat_f32(0.0)
    inside = (x >= zero) & (y >= zero) & (z >= zero)
    inside = inside & (x < np.float32(size[0])) & (y < np.float32(size[1]))
    inside = mask & inside & (z < np.float32(size[2]))
    cell = (to_i32(z) * size[1] + to_i32(y)) * size[0] + to_i32(x)
    return gather_row(places.row, 0, cell, inside)


@kernel
def share_at(places, position, mask):
    """Return how much of the sky's irradiance arrives at positions."""
    return gather_row(places.share, 0, place_at(places, position, mask), mask)


@kernel
def choose_part(places, warp, row_of_place, x, y, mask):
    """Choose parts of the sky by numbers in [0, 1); return as `descend` does."""
    column, row = splat_i32(0), splat_i32(0)
    first = row_of_place * np.int32(places.count)
    for k in range(places.levels):
        block = first + row * warp.across[k] + (column + warp.start[k])
        column, row, x, y = descend(places.blocks, block, column, row, x, y, mask)
    return column, row, x, y


@kernel
def ratio_at(places, warp, row_of_place, column, row, mask):
    """Return the density at patches, relative to that of all places."""
    if places.levels == 0:
        return splat_f32(1.0)
    below = np.int32(warp.start.size - places.levels)
    column, row = column >> below, row >> below
    last = places.levels - 1
    block = row_of_place * np.int32(places.count) + warp.start[last]
    block = block + (row >> 1) * warp.across[last] + (column >> 1)
    v00, v10, v01, v11 = gather_columns(places.blocks, 0, block, mask)
    right, lower = (column & 1) != 0, (row & 1) != 0
    gives = select(lower, select(right, v11, v01), select(right, v10, v00))
    part = row * np.int32(places.across) + column
    return gives * gather_row(places.inverse, 0, part, mask)
