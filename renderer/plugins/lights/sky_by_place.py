"""Visibility of an environment by position: indoors, light samples go through windows.

Indoors most directions to the sky are blocked. Each cell of a grid stores the top of the
pyramid that samples directions (`hierarchical_warp`), with its sums weighted by the
fraction of each part of the sky that is visible from points in the cell. A fraction of all
samples ignores visibility, so parts that were not seen add noise, but no bias.
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
"""Fraction of samples that ignore visibility: pdfs are at least this fraction of those
without cells. With a sun it applies twice: between sun and sky, and within the sky."""
MOST_PARTS = 512
"""Largest number of parts of the sky whose visibility is stored; about 11 degrees wide."""

_LEAST = 1e-30

Floats = NDArray[np.float64]


@table_columns("blocks")
class SkyByPlace(NamedTuple):
    """Row 0 of the tables is for positions outside of all cells: no occlusion."""

    levels: int  # levels of the pyramid that each cell replaces; 0: there are no cells
    low: NDArray[np.float32]  # (3,) lower corner of the grid, world
    cells: float  # cells per unit of length
    size: NDArray[np.int32]  # (3,) number of cells along x, y, z
    row: NDArray[np.int32]  # (x y z,) table row of each cell, x fastest
    blocks: NDArray[np.float32]  # (4, rows n) the first n blocks of `Warp.blocks`, by row
    count: int  # n
    inverse: NDArray[np.float32]  # (parts,) 1 / probability of each part without cells
    columns: int  # number of columns of parts
    # (rows,) irradiance relative to an unoccluded sky of the same mean radiance, at most 1
    share: NDArray[np.float32]
    sky: NDArray[np.float32]  # (rows,) probability of sampling the sky and not the sun


class Cells(NamedTuple):
    """The grid of cells."""

    low: Floats  # (3,) lower corner of the grid, world
    width: float  # of a cell
    size: NDArray[np.int64]  # (3,) number of cells along x, y, z
    row: NDArray[np.int64]  # (x y z,) table row of each cell, from 1 on; 0: no cell


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
"""No cells: the visibility is 1 everywhere."""


def parts_of_sky(warp: Warp) -> tuple[int, Floats]:
    """Return the number of levels above the parts of the sky, and each part's probability.

    Returns
    -------
    levels : int
        At least 1; a warp has two patches or more.
    gives : ndarray of shape (rows, columns)
        Sums to 1. Parts beyond the edge of the image have probability 0.
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
    # smaller ones are 0 in single precision or have no inverse there: never sampled
    return levels, np.where(gives < _LEAST, 0.0, gives)


def sky_by_place(
    warp: Warp, cells: Cells, seen: Floats, sun: Floats | float, sky_gives: float
) -> SkyByPlace:
    """Return the tables.

    Parameters
    ----------
    seen : ndarray of shape (rows of cells, rows, columns)
        Visible fraction of each part of the sky from a cell, in [0, 1].
    sun : ndarray of shape (rows of cells,)
        Visible fraction of the sun.
    sky_gives : float
        The sky's fraction of all light; 1 without a sun.
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
        # times 2: a surface sees at most half of all directions
        np.append(1.0, np.minimum(2.0 * both, 1.0)).astype(np.float32),
        sky.astype(np.float32),
    )


def in_world(rotation: NDArray[np.float32], local: Iterable[Floats]) -> Floats:
    """Return world space directions (3, n) for local x, y and z.

    Without `@`, whose last bits depend on the processor.
    """
    axes = rotation.astype(np.float64).T[..., None]
    x, y, z = (axis * part for axis, part in zip(axes, local, strict=True))
    return x + y + z


@kernel
def place_at(places, position, mask):
    """Return the table rows of the cells that contain positions."""
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
    """Return the visible fraction of the sky's irradiance at positions."""
    return gather_row(places.share, 0, place_at(places, position, mask), mask)


@kernel
def sky_share_at(places, position, mask):
    """Return the probability at positions of sampling the sky and not the sun."""
    return gather_row(places.sky, 0, place_at(places, position, mask), mask)


@kernel
def sample_by_place(places, warp, position, x, y, mask):
    """Map numbers in [0, 1) to (u, v) of the unit square, by visibility at a position.

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
    """Return the pdf of `sample_by_place` in (u, v)."""
    density = warp_density(warp, u, v, mask)
    if places.levels == 0:
        return density
    column, row, _, _ = patch_at(warp, u, v)
    here = place_at(places, position, mask)
    return density * _ratio(places, warp, here, column, row, mask)


@kernel
def _ratio(places, warp, row_of_place, column, row, mask):
    """Return the pdf at patches, relative to the pdf without visibility."""
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
