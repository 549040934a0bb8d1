"""Samples into a tile's sums: weighted by the filter, in double precision, in order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import lane_index_4, select, to_double, to_f32
from renderer.kernels.lanes.memory import load_four, load_one, store_one, store_row
from renderer.kernels.records.batch import CAPACITY
from renderer.kernels.records.tile import pixel_slot, slot_pixel
from renderer.scene.reconstruction import tabulate
from renderer.scene_file.description import ReconstructionFilter


class FilterTable(NamedTuple):
    """A tabulated filter that is wider than its own pixel."""

    radius: float  # [pixels]
    weights: NDArray[np.float64]  # (steps + 1,) at the lower ends of equal parts
    # (m, n) linear combinations of the first n channels, whose squares are the m channels
    # behind these: second moments; None without them
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
def square_sums(squares, radiance, level):
    """Write the squares of sums of the first channels to the channels behind them."""
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
    """Set the light of all slots to zero, before their samples are traced."""
    for channel in range(radiance.shape[0]):
        for slot in range(CAPACITY << 2 * level):
            radiance[channel, slot] = 0.0


@kernel
def _four_samples(radiance, channel, x, y, later, level):
    """Return one number of sample `later` of four pixels of a row."""
    value = to_f32(lane_index_4())
    # slots of samples differ in the bits that a pixel's first slot leaves free
    sample = pixel_slot(0, 0, later, level)
    for k in range(4):
        number = load_one(radiance, channel, pixel_slot(x + k, y, 0, level) | sample)
        value = select(lane_index_4() == np.int32(k), value * 0.0 + number, value)
    return value


@kernel
def _add_to_own_pixels(tile, radiance, sums):
    """Add each pixel's samples to it alone, one after the other, four pixels at once."""
    channels, level = sums.shape[0] - 1, tile.level
    together = 1 << 2 * level
    for y in range(tile.height):
        for x in range(0, tile.width, 4):
            for c in range(channels):
                plane = sums[c]
                value = load_four(plane, y, x)
                # beyond the tile's edge zeros are added to zeros
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
        _copy(sums, splats, np.bool_(True))


@kernel
def close_sums(rfilter, sums, splats):
    """Copy them back."""
    if rfilter.weights.size != 0:
        _copy(sums, splats, np.bool_(False))


@kernel
def _copy(sums, splats, there):  # both ways by one kernel: a constant would make two
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

    Pixel centres are integers here. The channels of one pixel are added together. Adding
    several columns at once is slower: the next sample would load a part of what was just
    stored, and wait for it.
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

    `film` has the samples' places on the full film, (2, slots) in pixels. Except for the
    box filter samples are added to `splats`, between `open_sums` and `close_sums`. The
    order of the sums of a pixel does not depend on how many samples are traced together.
    """
    square_sums(rfilter.squares, radiance, tile.level)
    if rfilter.weights.size == 0:  # the box
        _add_to_own_pixels(tile, radiance, sums)
        return
    for later in range(1 << 2 * tile.level):
        for place in range(CAPACITY):
            x, y = slot_pixel(place, 0)
            if x < tile.width and y < tile.height:
                slot = pixel_slot(x, y, later, tile.level)
                # its place in the sums, whose pixel 0 lies `border` before the tile
                px = np.float64(load_one(film, 0, slot)) - tile.x + border - 0.5
                py = np.float64(load_one(film, 1, slot)) - tile.y + border - 0.5
                _add_one(rfilter, px, py, slot, radiance, sums, splats)
