"""The film: samples to a tile's sums, sums to pixels, and work counts to colours."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.kernels.jit import compiled_for, entry_kernel, kernel
from renderer.kernels.lanes.functions import lane_index_4, select, to_double, to_f32
from renderer.kernels.lanes.memory import load_four, load_one, store_one, store_row
from renderer.kernels.records.batch import (
    BOXES,
    CAPACITY,
    NAMES,
    PRIMITIVES,
    TILE_SIZE,
    pixel_slot,
    slot_pixel,
)
from renderer.scene.reconstruction import tabulate
from renderer.scene_file.description import ReconstructionFilter

# --------------------------------------------------------------------------------- film
# Samples are added to a tile's sums: filter-weighted, in double precision, in fixed order.


class FilterTable(NamedTuple):
    """A tabulated reconstruction filter that is wider than its own pixel."""

    radius: float  # [pixels]
    weights: NDArray[np.float64]  # (steps + 1,) at the lower ends of equal intervals
    # (m, n) linear combinations of the first n channels. Their squares are the m channels
    # that follow: second moments. None without moments
    squares: NDArray[np.float32] | None = None


BOX = FilterTable(0.0, np.zeros(0))


def filter_table(rfilter: ReconstructionFilter) -> FilterTable:
    """Return the filter's table; empty for the box, whose samples stay in their pixel."""
    if rfilter.name == "box":
        return BOX
    return FilterTable(float(rfilter.radius), tabulate(rfilter))


def filter_border(table: FilterTable) -> int:
    """Return how many pixels beyond its tile a sample can contribute to."""
    return 0 if table.weights.size == 0 else int(np.ceil(table.radius + 0.5))


@kernel
def square_sums(squares, radiance, level):
    """Write squares of combinations of the first channels to the channels after them."""
    if squares is None:
        return
    rows, columns = squares.shape
    for slot in range(CAPACITY << 2 * level):
        for row in range(rows):
            value = np.float32(0.0)
            for column in range(columns):
                value += squares[row, column] * radiance[column, slot]
            radiance[columns + row, slot] = value * value


@kernel
def clear(radiance, level):
    """Set the radiance of all slots to zero before a group of samples is traced."""
    for channel in range(radiance.shape[0]):
        for slot in range(CAPACITY << 2 * level):
            radiance[channel, slot] = 0.0


@kernel
def _four_samples(radiance, channel, x, y, later, level):
    """Return one channel of sample `later` of four neighbouring pixels of a row."""
    value = to_f32(lane_index_4())
    # the sample index uses the bits that a pixel's first slot leaves zero
    sample = pixel_slot(0, 0, later, level)
    for k in range(4):
        number = load_one(radiance, channel, pixel_slot(x + k, y, 0, level) | sample)
        value = select(lane_index_4() == np.int32(k), value * 0.0 + number, value)
    return value


@kernel
def _add_to_own_pixels(tile, radiance, sums):
    """Add each pixel's samples to that pixel in sequence, four pixels at a time."""
    channels, level = sums.shape[0] - 1, tile.level
    together = 1 << 2 * level
    for y in range(tile.height):
        for x in range(0, tile.width, 4):
            for c in range(channels):
                plane = sums[c]
                value = load_four(plane, y, x)
                # lanes beyond the tile's edge add zeros to zeros
                for later in range(together):
                    value += to_double(_four_samples(radiance, c, x, y, later, level))
                store_row(plane, y, x, value)
            plane = sums[channels]
            before = load_four(plane, y, x)
            inside = lane_index_4() + np.int32(x) < np.int32(tile.width)
            more = np.float64(together)
            store_row(plane, y, x, select(inside, before + more, before))


@kernel
def _four_numbers(radiance, slot, first, channels):
    """Return channels `first` .. first + 3 of a sample; the last is its weight, 1."""
    zero = to_double(to_f32(lane_index_4())) * 0.0  # a zero of four lanes
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
    """Copy a tile's sums to `splats`, where the channels of a pixel are adjacent."""
    if rfilter.weights.size != 0:
        _copy(sums, splats, np.bool_(True))


@kernel
def close_sums(rfilter, sums, splats):
    """Copy `splats` back to the tile's sums."""
    if rfilter.weights.size != 0:
        _copy(sums, splats, np.bool_(False))


@kernel
def _copy(sums, splats, there):  # `there` is no constant: that would compile two kernels
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
    """Add the sample of a slot, at (x, y) in the sums, to all pixels within the filter.

    Pixel centres are integers here. The channels of a pixel are added together. Adding
    several columns at once is slower: the next sample would load part of what was just
    stored, and stall.
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
    """Add the samples of a tile's slots, `radiance` (channels, slots), to its sums.

    `film` has the samples' positions on the full film, (2, slots) [pixels]. Unless the
    filter is the box, samples are added to `splats`, between `open_sums` and `close_sums`.
    The summation order in a pixel does not depend on how many samples are traced together.
    """
    square_sums(rfilter.squares, radiance, tile.level)
    if rfilter.weights.size == 0:  # the box filter
        _add_to_own_pixels(tile, radiance, sums)
        return
    for later in range(1 << 2 * tile.level):
        for place in range(CAPACITY):
            x, y = slot_pixel(place, 0)
            if x < tile.width and y < tile.height:
                slot = pixel_slot(x, y, later, tile.level)
                # position in the sums, whose pixel 0 lies `border` before the tile
                px = np.float64(load_one(film, 0, slot)) - tile.x + border - 0.5
                py = np.float64(load_one(film, 1, slot)) - tile.y + border - 0.5
                _add_one(rfilter, px, py, slot, radiance, sums, splats)


# ------------------------------------------------------------------------------ develop
# A tile's sums become pixels: each sum is divided by the sum of weights.


class TileGrid(NamedTuple):
    """The layout of tiles over a window of the film."""

    rows: int
    columns: int
    beyond: int  # [pixels] by which the first tiles extend above and left of the window
    border: int  # [pixels] by which a tile's sums extend beyond it on each side
    layers: int  # number of sums per tile


@entry_kernel
def _develop_rows(lines, grid, picture, totals, first, end, to_x, to_y):
    """Write rows first .. end - 1 of sum(w v) / sum(w); 0 where there is no weight.

    Each row of the picture is added up in the memory order of the tiles' rows. Adding
    pixel by pixel took seven times as long.

    Parameters
    ----------
    lines
        (places * (channels + 1) * rows, columns), the sums of all tiles.
    grid
        The layout of the tiles.
    picture
        (height, width * channels), the output.
    totals
        (channels + 1, width of the window), scratch.
    first, end
        Rows of the window.
    to_x, to_y
        Position of the window in the picture [pixels].
    """
    channels, width, size = totals.shape[0] - 1, totals.shape[1], lines.shape[1]
    for y in range(first, end):
        for c in range(channels + 1):
            for x in range(width):
                store_one(totals, c, x, 0.0)
        row = y + grid.beyond
        below = min((row + grid.border) // TILE_SIZE, grid.rows - 1)
        above = max((row - grid.border) // TILE_SIZE, 0)  # first tile row that covers row
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

    Layers are added in their order. Tiles are added too where their borders overlap.
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
    """Return the compiled `_develop_rows`, without Numba's dispatcher.

    The dispatcher looks up the type of each argument, which takes as long as developing a
    tile.
    """
    nothing = np.empty((0, 0)), TileGrid(0, 0, 0, 0, 0), np.empty((0, 0), np.float32)
    found: Callable[..., None] = compiled_for(
        _develop_rows, *nothing, np.empty((0, 0)), 0, 0, 0, 0
    )
    return found


# ----------------------------------------------------------------------------- heat map
# The work per pixel: five counters as AOVs, and their sum as a colour.

# The colour scale in Oklab (L, a, b) [Ottosson2020]: black, violet, red, orange, pale
# yellow. L grows evenly, so equal steps of work are equal steps of lightness and the
# picture survives a grey printer. Every colour lies within sRGB.
CONTROL_POINTS = np.array(
    [
        [0.00, 0.000, 0.000],
        [0.24, 0.055, -0.105],
        [0.48, 0.160, -0.020],
        [0.72, 0.100, 0.120],
        [0.96, -0.020, 0.070],
    ]
)
# Oklab to the cube roots of cone responses, and cone responses to linear sRGB
_ROOTS_FROM_OKLAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_SRGB_FROM_CONES = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


class HeatMap(NamedTuple):
    """A false-colour picture of work per pixel."""

    pixels: NDArray[np.float32]  # (H, W, 3) linear sRGB
    aovs: dict[str, NDArray[np.float32]]  # "work.nodes" and so on -> (H, W, 1)
    brightest: float  # box and primitive tests per camera ray at the top of the scale


def heat_colours(values: ArrayLike, brightest: float) -> NDArray[np.float32]:
    """Return the colours of values from 0 (black) to `brightest` (pale yellow).

    Parameters
    ----------
    values
        Array of any shape. Values above `brightest` are clamped to it.
    brightest
        Pass the same number for several pictures to give them one scale. 0 makes
        everything black.

    Returns
    -------
    Linear sRGB, float32, with the shape of `values` and a last axis of 3.
    """
    scaled = np.asarray(values, np.float64) / brightest if brightest > 0.0 else 0.0
    place = np.clip(scaled + np.zeros(np.shape(values)), 0.0, 1.0)
    stations = np.linspace(0.0, 1.0, len(CONTROL_POINTS))
    lab = np.stack([np.interp(place, stations, axis) for axis in CONTROL_POINTS.T], -1)
    linear = ((lab @ _ROOTS_FROM_OKLAB.T) ** 3) @ _SRGB_FROM_CONES.T
    return np.clip(linear, 0.0, 1.0).astype(np.float32)


def heat_map(counts: NDArray[np.float32]) -> HeatMap:
    """Return the picture of the counts (H, W, tally rows), which are means over samples.

    The pixel with the most box and primitive tests gets the brightest colour.
    """
    aovs = {
        f"work.{name.replace(' ', '_')}": np.ascontiguousarray(counts[..., row, None])
        for row, name in enumerate(NAMES)
    }
    tests = counts[..., BOXES].astype(np.float64) + counts[..., PRIMITIVES]
    brightest = float(tests.max(initial=0.0))
    return HeatMap(heat_colours(tests, brightest), aovs, brightest)
