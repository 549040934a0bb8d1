"""The film: weighted sums of samples in double precision, per tile, then per picture.

Each tile has sums of its own, with a border as wide as the filter, and samples are added to
them in their order; they are put together at the end, in a fixed order too. So nothing
depends on which thread was first, and threads share no memory that they write to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import compiled_for, entry_kernel, kernel
from renderer.kernels.lanes.functions import lane_index_4, select, to_double, to_f32
from renderer.kernels.lanes.memory import load_four, load_one, store_one, store_row
from renderer.kernels.records.batch import CAPACITY
from renderer.kernels.records.tile import TILE_SIZE, Tile, slot_pixel
from renderer.scene.reconstruction import tabulate
from renderer.scene_file.description import ReconstructionFilter
from renderer.threads import in_threads


class FilterTable(NamedTuple):
    """A tabulated filter that is wider than its own pixel."""

    radius: float  # [pixels]
    weights: NDArray[np.float64]  # (steps + 1,) at the lower ends of equal parts
    # (m, n) sums of the first n channels whose squares are the m channels behind these:
    # second moments; None: there are none
    squares: NDArray[np.float32] | None = None


BOX = FilterTable(0.0, np.zeros(0))


def filter_table(rfilter: ReconstructionFilter) -> FilterTable:
    """Return the table of a filter; the box has none: its samples stay in their pixel."""
    if rfilter.name == "box":
        return BOX
    return FilterTable(float(rfilter.radius), tabulate(rfilter))


def filter_border(table: FilterTable) -> int:
    """Return how many pixels beyond its tile a sample can reach."""
    return 0 if table.weights.size == 0 else int(np.ceil(table.radius + 0.5))


@kernel
def square_sums(squares, radiance):
    """Write the squares of sums of the first channels to the channels behind them."""
    if squares is None:
        return
    rows, columns = squares.shape
    for slot in range(CAPACITY):
        for row in range(rows):
            value = np.float32(0.0)
            for column in range(columns):
                value += squares[row, column] * radiance[column, slot]
            radiance[columns + row, slot] = value * value


@kernel
def clear(radiance):
    """Set the light of all slots to zero, before a sample is traced."""
    for channel in range(radiance.shape[0]):
        for slot in range(CAPACITY):
            radiance[channel, slot] = 0.0


@kernel
def _add_to_own_pixels(tile, radiance, sums):
    """Add each sample to its pixel alone, four of a row at once."""
    channels = sums.shape[0] - 1
    for first in range(0, CAPACITY, 4):
        x, y = slot_pixel(first)
        if x >= tile.width or y >= tile.height:
            continue
        for c in range(channels):
            plane = sums[c]
            # beyond the tile's edge zeros are added to zeros
            sample = to_double(load_four(radiance, c, first))
            store_row(plane, y, x, load_four(plane, y, x) + sample)
        plane = sums[channels]
        before = load_four(plane, y, x)
        inside = lane_index_4() + np.int32(x) < np.int32(tile.width)
        store_row(plane, y, x, select(inside, before + 1.0, before))


@kernel
def _four_numbers(radiance, slot, first, channels):
    """Return numbers `first` .. first + 3 of a sample; the last of all is its weight, 1."""
    zero = to_double(to_f32(lane_index_4())) * 0.0  # a constant of four lanes
    value = zero
    for k in range(4):
        c = first + k
        if c < channels:
            number = np.float64(load_one(radiance, c, slot))
        else:
            number = 1.0 if c == channels else 0.0
        value = select(lane_index_4() == np.int32(k), (zero + 1.0) * number, value)
    return value


@kernel
def open_sums(rfilter, sums, splats):
    """Copy a tile's sums to where a pixel's numbers lie side by side, for `add_to_tile`."""
    if rfilter.weights.size != 0:
        _copy(sums, splats, True)


@kernel
def close_sums(rfilter, sums, splats):
    """Copy them back."""
    if rfilter.weights.size != 0:
        _copy(sums, splats, False)


@kernel
def _copy(sums, splats, there):
    numbers, size = sums.shape[0], sums.shape[2]
    for c in range(numbers):
        plane, first = sums[c], (c // 4) * 4 * size * size + c % 4
        for row in range(size):
            for column in range(size):
                i = first + 4 * (row * size + column)
                if there:
                    store_one(splats, 0, i, load_one(plane, row, column))
                else:
                    store_one(plane, row, column, load_one(splats, 0, i))


@kernel
def _add_one(rfilter, x, y, slot, radiance, sums, splats):
    """Add the sample of a slot, at (x, y) in the sums, to all pixels that it reaches.

    A pixel's centre is a whole number here. A pixel's numbers are added together: with
    several columns at once, what a sample has just stored the next one loads in part, and
    has to wait for it.
    """
    channels, size = sums.shape[0] - 1, sums.shape[2]
    pixels, groups = size * size, channels // 4 + 1
    weights, radius = rfilter.weights, rfilter.radius
    steps = weights.size - 1
    scale = steps / radius
    left, right = int(np.ceil(x - radius)), int(x + radius)
    of_columns = 4 * pixels * groups - left
    for column in range(left, right + 1):
        step = min(int(abs(column - x) * scale), steps)
        store_one(splats, 0, of_columns + column, load_one(weights, 0, step))
    for group in range(groups):
        value = _four_numbers(radiance, slot, 4 * group, channels)
        for row in range(int(np.ceil(y - radius)), int(y + radius) + 1):
            of_row = load_one(weights, 0, min(int(abs(row - y) * scale), steps))
            first = 4 * (group * pixels + row * size)
            for column in range(left, right + 1):
                weight = of_row * load_one(splats, 0, of_columns + column)
                i = first + 4 * column
                store_row(splats, 0, i, load_four(splats, 0, i) + value * weight)


@kernel
def add_to_tile(rfilter, tile, film, radiance, sums, splats, border):
    """Add one sample of each pixel of a tile, `radiance` (channels, slots), to its sums.

    `film` has the samples' places on the full film, (2, slots) in pixels. But for the box,
    samples are added to `splats`, between `open_sums` and `close_sums`.
    """
    square_sums(rfilter.squares, radiance)
    if rfilter.weights.size == 0:  # the box
        _add_to_own_pixels(tile, radiance, sums)
        return
    for slot in range(CAPACITY):
        x, y = slot_pixel(slot)
        if x < tile.width and y < tile.height:
            # the sample's place in the sums, whose pixel 0 lies `border` before the tile
            px = np.float64(load_one(film, 0, slot)) - tile.x + border - 0.5
            py = np.float64(load_one(film, 1, slot)) - tile.y + border - 0.5
            _add_one(rfilter, px, py, slot, radiance, sums, splats)


ALONE = 2**17  # pixels that one thread develops while others would start


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
    """Return the kernel that develops, without Numba's look at each argument.

    Its parameters are those of `_develop_rows`. A call of the kernel itself would take as
    long as what it does for a tile.
    """
    nothing = np.empty((0, 0)), TileGrid(0, 0, 0, 0, 0), np.empty((0, 0), np.float32)
    found: Callable[..., None] = compiled_for(
        _develop_rows, *nothing, np.empty((0, 0)), 0, 0, 0, 0
    )
    return found


class Film:
    """The picture's sums, for the crop window: those of each tile in a place of its own.

    Parameters
    ----------
    channels : int
        Numbers for each pixel, without the weight.
    x, y, width, height : int
        The crop window in pixels of the full film.
    border : int
        From `filter_border`.
    film_width : int
        Of the full film, with what is sampled beyond it.
    beyond : int
        Pixels on all sides of the window that are sampled too.
    sums_in_all : int
        A film of fewer tiles has several sums for each, about so many together, so that
        threads can work on one tile at the same time.

    Attributes
    ----------
    tiles : int64 (n, 5)
        What a `Tile` says of each: of the window and what lies beyond, row after row.
    sums : float64 (layers * tiles, channels + 1, rows, columns)
        Of each tile with its border, layer after layer; the last channel is the weight.
        Memory is taken when a tile is first written to.
    """

    def __init__(
        self,
        channels: int,
        x: int,
        y: int,
        width: int,
        height: int,
        border: int,
        film_width: int,
        beyond: int = 0,
        sums_in_all: int = 1,
    ) -> None:
        self.x, self.y, self.width, self.height = x, y, width, height
        right, below = x + width + beyond, y + height + beyond
        rows = np.arange(y - beyond, below, TILE_SIZE)
        columns = np.arange(x - beyond, right, TILE_SIZE)
        i, j = np.tile(columns, len(rows)), np.repeat(rows, len(columns))
        sizes = np.minimum(TILE_SIZE, right - i), np.minimum(TILE_SIZE, below - j)
        self.tiles = np.stack(Tile(i, j, *sizes, np.full(len(i), film_width)), axis=1)
        layers = max(1, sums_in_all // len(self.tiles))
        self.grid = TileGrid(len(rows), len(columns), beyond, border, layers)
        size = TILE_SIZE + 2 * border
        self.sums = np.zeros((layers * len(self.tiles), channels + 1, size, size))

    def tile(self, number: int) -> Tile:
        """Return a tile by its place in `tiles`."""
        return Tile(*self.tiles[number].tolist())

    @property
    def has_separate_tiles(self) -> bool:
        """Whether each pixel of the window is a matter of one sum alone."""
        grid = self.grid
        return grid.border == grid.beyond == 0 and grid.layers == 1

    def compile(self) -> None:
        """Compile what `develop` calls, or load it."""
        develop_rows(self.sums, self.grid, np.empty((0, 0, 1), np.float32), 0, 0)

    def develop(
        self, threads: int = 1, sums: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Return sum(w v) / sum(w), float32 (height, width, channels); 0 without weight.

        `sums` are others than the film's own, such as those of half of the samples.
        """
        sums = self.sums if sums is None else sums
        picture = np.empty((self.height, self.width, self.sums.shape[1] - 1), np.float32)
        bands = -(-self.height // TILE_SIZE)

        def develop_band(band: int) -> None:
            first = band * TILE_SIZE
            end = min(first + TILE_SIZE, self.height)
            develop_rows(sums, self.grid, picture, first, end)

        alone = self.height * self.width < ALONE
        in_threads(1 if alone else threads, bands, develop_band)
        return picture
