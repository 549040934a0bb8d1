"""From the sums of a film's tiles to its picture: the sums, divided by their weights."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import compiled_for, entry_kernel
from renderer.kernels.lanes.memory import load_one, store_one
from renderer.kernels.records.tile import TILE_SIZE


class TileGrid(NamedTuple):
    """How tiles lie over a window of the film."""

    rows: int
    columns: int
    beyond: int  # pixels that the first tiles begin above and left of the window
    border: int  # pixels that a tile's sums hold beyond it on all sides
    layers: int  # how many sums each tile has


@entry_kernel
def _develop_rows(lines, grid, picture, totals, first, end, to_x, to_y):
    """Write rows first .. end - 1 of sum(w v) / sum(w); 0 where there is no weight.

    A row of the picture is added up line by line of the tiles, as they lie in memory: pixel
    by pixel it took seven times as long.

    Parameters
    ----------
    lines
        (places * (channels + 1) * rows, columns) of all sums.
    grid
        How the tiles lie.
    picture
        (height, width * channels).
    totals
        (channels + 1, width of the window) to work in.
    first, end
        Rows of the window.
    to_x, to_y
        Where in the picture the window begins.
    """
    channels, width, size = totals.shape[0] - 1, totals.shape[1], lines.shape[1]
    for y in range(first, end):
        for c in range(channels + 1):
            for x in range(width):
                store_one(totals, c, x, 0.0)
        row = y + grid.beyond
        below = min((row + grid.border) // TILE_SIZE, grid.rows - 1)
        above = max((row - grid.border) // TILE_SIZE, 0)  # its border ends here
        for layer in range(grid.layers):
            for j in range(above, below + 1):
                for i in range(grid.columns):
                    place = (layer * grid.rows + j) * grid.columns + i
                    inside_y = row - j * TILE_SIZE + grid.border
                    start = i * TILE_SIZE - grid.border - grid.beyond
                    left, right = max(start, 0), min(start + size, width)
                    for c in range(channels + 1):
                        line = (place * (channels + 1) + c) * size + inside_y
                        for x in range(left, right):
                            more = load_one(lines, line, x - start)
                            store_one(totals, c, x, load_one(totals, c, x) + more)
        for x in range(width):
            weight = load_one(totals, channels, x)
            inverse = 1.0 / weight if weight != 0.0 else 0.0
            for c in range(channels):
                at = (to_x + x) * channels + c
                store_one(picture, to_y + y, at, load_one(totals, c, x) * inverse)


def develop_rows(
    sums: NDArray[np.float64],
    grid: TileGrid,
    picture: NDArray[np.float32],
    first: int,
    end: int,
) -> None:
    """Write rows first .. end - 1 of a picture (height, width, channels).

    Layers are added in their order, and where borders overlap, so are tiles.
    """
    height, width, channels = picture.shape
    _develop_rows(
        sums.reshape(-1, sums.shape[-1]),
        grid,
        picture.reshape(height, width * channels),
        np.empty((channels + 1, width)),
        first,
        end,
        0,
        0,
    )


def compiled_development() -> Callable[..., None]:
    """Return the compiled `_develop_rows`, to be called without Numba's dispatcher.

    The dispatcher looks up the type of each argument, which takes as long as developing a
    tile.
    """
    nothing = np.empty((0, 0)), TileGrid(0, 0, 0, 0, 0), np.empty((0, 0), np.float32)
    found: Callable[..., None] = compiled_for(
        _develop_rows, *nothing, np.empty((0, 0)), 0, 0, 0, 0
    )
    return found
