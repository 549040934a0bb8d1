"""What each place sees of an environment, so that light samples go to windows.

Indoors most directions to a sky are blocked. A grid of cells holds, for each cell, the top
of the pyramid that chooses directions (`hierarchical_warp`) with its sums weighted by how
much of each part of the sky points nearby see. A share of all samples ignores that, so that
what was not seen adds noise, but never a bias.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel, table_columns
from renderer.kernels.lanes.functions import select, splat_f32, splat_i32, to_i32
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.plugins.sampling.hierarchical_warp import (
    Warp,
    choose_patch_below,
    descend,
    patch_at,
    place_in_patch,
    pyramid,
    sample_warp,
    warp_density,
)

UNSEEN = 0.05
"""The share of samples that ignore what is seen: densities are at least this share of those
without cells. With a sun it counts twice: for the sky's samples, and for its parts."""
MOST_PARTS = 512
"""Of the sky, of which each cell knows how much is seen; a part is 11 degrees wide then."""

_LEAST = 1e-30

Floats = NDArray[np.float64]


@table_columns("blocks")
class SkyByPlace(NamedTuple):
    """Row 0 of the tables is for places outside of all cells: they see the whole sky."""

    levels: int  # of the pyramid that each cell has itself; 0: there are no cells
    low: NDArray[np.float32]  # (3,) corner of the grid, world
    cells: float  # per unit of length
    size: NDArray[np.int32]  # (3,) cells along x, y, z
    row: NDArray[np.int32]  # (x y z,) of each cell, x first
    blocks: NDArray[np.float32]  # (4, rows n) the first n blocks of `Warp.blocks`, by row
    count: int  # n
    inverse: NDArray[np.float32]  # (parts,) 1 / what each part of the sky gives
    columns: int  # of parts
    # (rows,) irradiance relative to that of a whole sky of the same mean, at most 1
    share: NDArray[np.float32]
    sky: NDArray[np.float32]  # (rows,) share of samples that go to the sky, not to a sun


class Cells(NamedTuple):
    """Where cells are."""

    low: Floats  # (3,) corner of the grid, world
    width: float  # of a cell
    size: NDArray[np.int64]  # (3,) cells along x, y, z
    row: NDArray[np.int64]  # (x y z,) row of each cell, from 1 on; 0: none


NOWHERE = SkyByPlace(
    0,
    np.zeros(3, np.float32),
    0.0,
    np.zeros(3, np.int32),
    np.zeros(1, np.int32),
    by_columns(np.zeros((4, 0), np.float32)),
    0,
    np.ones(1, np.float32),
    1,
    np.ones(1, np.float32),
    np.ones(1, np.float32),
)
"""There are no cells: all places sample the whole sky."""


def parts_of_sky(warp: Warp) -> tuple[int, Floats]:
    """Return the levels above the parts of the sky, and what each part gives.

    Returns
    -------
    levels : int
        At least 1; a warp has two patches or more.
    gives : ndarray of shape (rows, columns)
        Their sum is 1. Parts beyond the edge of the image give 0.
    """
    ends = [*warp.start[1:], warp.blocks.shape[1]]
    levels = 0
    while levels < len(ends) and 4 * (ends[levels] - warp.start[levels]) <= MOST_PARTS:
        levels += 1
    last = levels - 1
    across = int(warp.across[last])
    blocks = warp.blocks[:, warp.start[last] : ends[last]].astype(np.float64)
    parts = blocks.reshape(2, 2, -1, across).transpose(2, 0, 3, 1)
    gives = parts.reshape(-1, 2 * across)
    gives = gives / gives.sum()
    # less is 0 in single precision, or has no inverse there: it is never chosen
    return levels, np.where(gives < _LEAST, 0.0, gives)


def sky_by_place(
    warp: Warp, cells: Cells, seen: Floats, sun: Floats | float, sky_gives: float
) -> SkyByPlace:
    """Return the tables.

    Parameters
    ----------
    seen : ndarray of shape (rows of cells, rows, columns)
        How much of each part of the sky is seen in a cell, in [0, 1].
    sun : ndarray of shape (rows of cells,)
        The same of a sun.
    sky_gives : float
        The part of all light that does not come from that sun; 1 without one.
    """
    levels, gives = parts_of_sky(warp)
    lit = gives * seen
    total = lit.sum(axis=(1, 2), keepdims=True)
    of_sky, of_sun = sky_gives * total.ravel(), (1.0 - sky_gives) * sun
    both = of_sky + of_sun
    sky = np.divide(of_sky, both, out=np.full_like(both, sky_gives), where=both > 0.0)
    sky = (1.0 - UNSEEN) * np.append(sky_gives, sky) + UNSEEN * sky_gives
    known = total > 0.0
    lit = np.where(known, lit / np.where(known, total, 1.0), gives)
    lit = np.concatenate([gives[None], (1.0 - UNSEEN) * lit + UNSEEN * gives])
    inverse = np.divide(1.0, gives, out=np.zeros_like(gives), where=gives > 0.0)
    blocks = [level.reshape(4, len(lit), -1) for level in pyramid(lit.astype(np.float32))]
    table = np.concatenate(blocks, axis=2)
    return SkyByPlace(
        levels,
        cells.low.astype(np.float32),
        1.0 / cells.width,
        cells.size.astype(np.int32),
        cells.row.astype(np.int32),
        by_columns(table.reshape(4, -1)),
        table.shape[2],
        np.ascontiguousarray(inverse.ravel(), np.float32),
        gives.shape[1],
        # twice: a surface sees half of all directions at most
        np.append(1.0, np.minimum(2.0 * both, 1.0)).astype(np.float32),
        sky.astype(np.float32),
    )


def in_world(rotation: NDArray[np.float32], local: Iterable[Floats]) -> Floats:
    """Return directions (3, n) of their local x, y and z.

    Without `@`, whose last bits depend on the processor.
    """
    axes = rotation.astype(np.float64).T[..., None]
    x, y, z = (axis * part for axis, part in zip(axes, local, strict=True))
    return x + y + z


@kernel
def place_at(places, position, mask):
    """Return the rows of the cells that positions are in."""
    low, size, cells = places.low, places.size, np.float32(places.cells)
    x = (position.x - low[0]) * cells
    y = (position.y - low[1]) * cells
    z = (position.z - low[2]) * cells
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
def sky_share_at(places, position, mask):
    """Return the share of samples at positions that go to the sky, not to a sun."""
    return gather_row(places.sky, 0, place_at(places, position, mask), mask)


@kernel
def sample_by_place(places, warp, position, x, y, mask):
    """Map numbers in [0, 1) to (u, v) of the unit square, as places see it.

    Returns
    -------
    u, v, density
        As `place_in_patch`.
    """
    if places.levels == 0:
        return sample_warp(warp, x, y, mask)
    here = place_at(places, position, mask)
    column, row = splat_i32(0), splat_i32(0)
    first = here * np.int32(places.count)
    for k in range(places.levels):
        block = first + row * warp.across[k] + (column + warp.start[k])
        column, row, x, y = descend(places.blocks, block, column, row, x, y, mask)
    column, row, x, y = choose_patch_below(warp, places.levels, column, row, x, y, mask)
    u, v, density = place_in_patch(warp, column, row, x, y, mask)
    return u, v, density * _ratio(places, warp, here, column, row, mask)


@kernel
def density_by_place(places, warp, position, u, v, mask):
    """Return the density with which `sample_by_place` chooses points of the square."""
    density = warp_density(warp, u, v, mask)
    if places.levels == 0:
        return density
    column, row, _, _ = patch_at(warp, u, v)
    here = place_at(places, position, mask)
    return density * _ratio(places, warp, here, column, row, mask)


@kernel
def _ratio(places, warp, row_of_place, column, row, mask):
    """Return the density at patches, relative to that of all places."""
    below = np.int32(warp.start.size - places.levels)
    column, row = column >> below, row >> below
    last = places.levels - 1
    block = row_of_place * np.int32(places.count) + warp.start[last]
    block = block + (row >> 1) * warp.across[last] + (column >> 1)
    v00, v10, v01, v11 = gather_columns(places.blocks, 0, block, mask)
    right, lower = (column & 1) != 0, (row & 1) != 0
    gives = select(lower, select(right, v11, v01), select(right, v10, v00))
    part = row * np.int32(places.columns) + column
    return gives * gather_row(places.inverse, 0, part, mask)
