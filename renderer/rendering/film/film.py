"""`Film`: weighted sums of pixels, and the number of samples of each tile."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.film import TileGrid, develop_rows
from renderer.kernels.records.batch import TILE_SIZE, Tile
from renderer.process.worker_pool import in_threads

# --------------------------------------------------------------------------------- work
# Which samples are added to each sum of the film, and in which order.
#
# A tile has one or more sums, its layers. A place is one tile in one layer. Its state is
# its sums and their number of samples. Samples are added in parts: part k of a tile
# belongs to layer k % layers, and the parts of a place are added in order. So the same
# numbers are added in the same order for any number of threads or processes, and after
# any interruption: all bits of the picture are equal.

# Samples of a pixel that are traced together: a tile takes some milliseconds.
SAMPLES_PER_JOB = 16


class Work(NamedTuple):
    """Assignment of samples to places.

    Place p is tile p % tiles in layer p // tiles, as in `Film.sums`. A place numbers its
    own samples: 0 .. n - 1 are the first ones that are added to it.
    """

    tiles: int
    layers: int
    part: int  # samples per pixel that are traced together

    @property
    def places(self) -> int:
        """Number of places."""
        return self.tiles * self.layers

    def samples(self, spp: int) -> NDArray[np.int64]:
        """Return the number of each place's samples among the first `spp` of a pixel."""
        parts, rest = divmod(spp, self.part)
        layer = np.arange(self.layers, dtype=np.int64)
        taken = (parts - layer + self.layers - 1) // self.layers * self.part
        taken[parts % self.layers] += rest
        return np.repeat(taken, self.tiles)

    def least_spp(self, samples: NDArray[np.int64]) -> int:
        """Return the smallest spp whose samples include all these samples of the places."""
        parts, inside = np.divmod(samples - 1, self.part)
        layer = np.arange(self.places) // self.tiles
        last = (parts * self.layers + layer) * self.part + inside
        return int(np.where(samples > 0, last + 1, 0).max())

    def pieces(self, place: int, begin: int, end: int) -> Iterator[tuple[int, int]]:
        """Yield the numbers in their pixel of samples begin .. end - 1 of a place.

        A pair (first, end) stands for samples first .. end - 1 of each pixel of the tile.
        """
        layer = place // self.tiles
        while begin < end:
            part, inside = divmod(begin, self.part)
            count = min(self.part - inside, end - begin)
            first = (part * self.layers + layer) * self.part + inside
            yield first, first + count
            begin += count


# --------------------------------------------------------------------------------- film
# Sums in double precision, per tile, which are then combined to the picture.
#
# Each tile has its own sums, with a border as wide as the filter. Samples are added in
# order, and the tiles are combined in a fixed order too. So the result does not depend on
# the timing of threads, and threads share no memory that they write to.

ALONE = 2**17  # pixels that one thread develops faster than others would start


class Film:
    """The sums of the picture in the crop window, separate for each tile.

    Parameters
    ----------
    channels : int
        Numbers per pixel, without the weight.
    x, y, width, height : int
        The crop window in pixels of the full film.
    border : int
        From `filter_border`.
    film_width : int
        Width of the full film, including the sampled border.
    beyond : int
        Pixels outside of the window, on each side, that are sampled too.
    sums_in_all : int
        Approximate total number of sums. A film of fewer tiles has several sums for each,
        so that threads can render the same tile simultaneously.
    part : int
        Samples of a pixel that are traced together.

    Attributes
    ----------
    tiles : int64 (n, 5)
        Position and size of each tile as in `Tile`, row by row; including the border.
    sums : float64 (layers * tiles, channels + 1, rows, columns)
        Of each tile with its border, layer by layer; the last channel is the weight. The
        operating system allocates memory when a tile is first written to.
    work : Work
        Which samples are added to each of the sums.
    samples : int64 (places,)
        Number of samples in each of the sums. With `sums` it is the whole state of a
        render: another one with the same plan can continue from copies of both.
    pixels : int
        Number of pixels of all tiles.
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
        part: int = SAMPLES_PER_JOB,
    ) -> None:
        self.x, self.y, self.width, self.height = x, y, width, height
        right, below = x + width + beyond, y + height + beyond
        rows = np.arange(y - beyond, below, TILE_SIZE)
        columns = np.arange(x - beyond, right, TILE_SIZE)
        i, j = np.tile(columns, len(rows)), np.repeat(rows, len(columns))
        widths, heights = np.minimum(TILE_SIZE, right - i), np.minimum(TILE_SIZE, below - j)
        film_widths = np.full(len(i), film_width)
        self.tiles = np.stack([i, j, widths, heights, film_widths], axis=1)
        layers = max(1, sums_in_all // len(self.tiles))
        self.grid = TileGrid(len(rows), len(columns), beyond, border, layers)
        size = TILE_SIZE + 2 * border
        self.sums = np.zeros((layers * len(self.tiles), channels + 1, size, size))
        self.work = Work(len(self.tiles), layers, part)
        self.samples = np.zeros(self.work.places, np.int64)
        self.pixels_of_place = np.tile(widths * heights, layers)
        self.pixels = int((widths * heights).sum())

    def tile(self, number: int) -> Tile:
        """Return a tile by its index in `tiles`."""
        return Tile(*self.tiles[number].tolist())

    @property
    def samples_done(self) -> int:
        """Number of samples in the film, over all pixels."""
        return int(self.samples @ self.pixels_of_place)

    @property
    def spp(self) -> float:
        """Samples per pixel so far; the mean if tiles have different numbers."""
        whole, rest = divmod(self.samples_done, self.pixels)
        return self.samples_done / self.pixels if rest else whole

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """Arrays with which another film can continue the render."""
        return {"sums": self.sums, "samples": self.samples}

    @property
    def has_separate_tiles(self) -> bool:
        """True if no pixel receives contributions of two sums."""
        grid = self.grid
        return grid.border == grid.beyond == 0 and grid.layers == 1

    def compile(self) -> None:
        """Compile the kernels of `develop`, or load them."""
        develop_rows(self.sums, self.grid, np.empty((0, 0, 1), np.float32), 0, 0)

    def develop(
        self, threads: int = 1, sums: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Return sum(w v) / sum(w), float32 (height, width, channels); 0 without weight.

        `sums` replace the film's own, such as sums of half of the samples.
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

    def so_far(self) -> NDArray[np.float32]:
        """Return the developed picture while threads add samples.

        A tile may be read between two writes, such as colour without its weight.
        """
        return self.develop()
