"""The film: weighted sums of samples in double precision, per tile, then per picture.

A tile sums into an array of its own, with a border as wide as the filter; the tiles are
added to the picture in a fixed order, so that no sum depends on which thread was first.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.lanes.functions import lane, lane_index
from renderer.lanes.memory import load_row
from renderer.records.batch import CAPACITY
from renderer.records.tile import TILE_SIZE, Tile, slot_pixel
from renderer.scene.reconstruction import tabulate
from renderer.scene_file.description import ReconstructionFilter


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


def tile_sums(channels: int, border: int) -> NDArray[np.float64]:
    """Return a zeroed array for one tile's sums; the last channel is the weight."""
    size = TILE_SIZE + 2 * border
    return np.zeros((channels + 1, size, size))


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
def add_to_tile(rfilter, tile, film, radiance, sums, border):
    """Add one sample of each pixel of a tile, `radiance` (channels, slots), to its sums.

    `film` has the samples' places on the full film, (2, slots) in pixels.
    """
    channels = sums.shape[0] - 1
    square_sums(rfilter.squares, radiance)
    if rfilter.weights.size == 0:  # the box: samples stay in their pixel
        for slot in range(CAPACITY):
            x, y = slot_pixel(slot)
            if x < tile.width and y < tile.height:
                for c in range(channels):
                    sums[c, y, x] += radiance[c, slot]
                sums[channels, y, x] += 1.0
        return
    steps = rfilter.weights.size - 1
    scale = steps / rfilter.radius
    for first in range(0, CAPACITY, 16):
        slots = lane_index() + first
        px, py = load_row(film, 0, first), load_row(film, 1, first)
        xs, ys = slot_pixel(slots)
        for j in range(16):
            if lane(xs, j) >= tile.width or lane(ys, j) >= tile.height:
                continue
            slot = first + j
            # the sample's place in the sums, whose pixel 0 lies `border` before the tile
            x = np.float64(lane(px, j)) - tile.x + border - 0.5
            y = np.float64(lane(py, j)) - tile.y + border - 0.5
            for row in range(int(np.ceil(y - rfilter.radius)), int(y + rfilter.radius) + 1):
                step_y = min(int(abs(row - y) * scale), steps)
                for column in range(
                    int(np.ceil(x - rfilter.radius)), int(x + rfilter.radius) + 1
                ):
                    step_x = min(int(abs(column - x) * scale), steps)
                    weight = rfilter.weights[step_y] * rfilter.weights[step_x]
                    for c in range(channels):
                        sums[c, row, column] += weight * radiance[c, slot]
                    sums[channels, row, column] += weight


class Film:
    """The picture's sums, for the crop window.

    Parameters
    ----------
    channels : int
        Numbers for each pixel, without the weight.
    x, y, width, height : int
        The crop window in pixels of the full film.
    border : int
        From `filter_border`.
    """

    def __init__(
        self, channels: int, x: int, y: int, width: int, height: int, border: int
    ) -> None:
        self.x, self.y, self.width, self.height = x, y, width, height
        self.border = border
        self._sums = np.zeros((channels + 1, height, width))

    def tiles(self, film_width: int, beyond: int = 0) -> list[Tile]:
        """Return the tiles of the window and `beyond` pixels on all sides, row after row.

        `film_width` is that of the full film.
        """
        right, below = self.x + self.width + beyond, self.y + self.height + beyond
        return [
            Tile(x, y, min(TILE_SIZE, right - x), min(TILE_SIZE, below - y), film_width)
            for y in range(self.y - beyond, below, TILE_SIZE)
            for x in range(self.x - beyond, right, TILE_SIZE)
        ]

    def add(self, tile: Tile, sums: NDArray[np.float64]) -> None:
        """Add a tile's sums; what its border holds beyond the window is dropped."""
        left, top = tile.x - self.x - self.border, tile.y - self.y - self.border
        x0, y0 = max(left, 0), max(top, 0)
        x1 = min(left + sums.shape[2], self.width)
        y1 = min(top + sums.shape[1], self.height)
        part = sums[:, y0 - top : y1 - top, x0 - left : x1 - left]
        self._sums[:, y0:y1, x0:x1] += part

    def develop(self) -> NDArray[np.float32]:
        """Return sum(w v) / sum(w), float32 (height, width, channels); 0 without weight."""
        weight = self._sums[-1]
        inverse: Any = np.divide(1.0, weight, out=np.zeros_like(weight), where=weight != 0)
        picture = np.empty((*weight.shape, len(self._sums) - 1), np.float32)
        for channel, sums in enumerate(self._sums[:-1]):  # one at a time, for the memory
            picture[..., channel] = sums * inverse
        return picture
