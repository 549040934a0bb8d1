"""`Film`: weighted sums of pixels, and how many samples each tile holds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.film import TileGrid, develop_rows
from renderer.kernels.records.batch import TILE_SIZE, Tile
from renderer.process.worker_pool import in_threads

# --------------------------------------------------------------------------------- work
# The work of a render: which samples each sum of the film takes, and in which order.
#
# A tile has one sum or more, its layers. A place is one tile in one layer: its sums, and
# how many samples they hold, are all there is to know about it. Samples go in parts: part
# k of a tile belongs to layer k % layers, and a place takes its own parts one after the
# other. In one thread or in many processes, without a break or with several, the same
# numbers are added in the same order: no bit of the picture depends on what adds them.

# Samples of a pixel that are traced together: so many that a tile takes milliseconds.
SAMPLES_PER_JOB = 16


class Work(NamedTuple):
    """How samples are dealt out to places.

    Place p is tile p % tiles in layer p // tiles, as in `Film.sums`. It counts its samples
    for itself: its samples 0 .. n - 1 are those that it takes first.
    """

    tiles: int
    layers: int
    part: int  # samples that are traced in one go

    @property
    def places(self) -> int:
        """How many places there are."""
        return self.tiles * self.layers

    def samples(self, spp: int) -> NDArray[np.int64]:
        """Return how many of the first `spp` samples of a pixel each place takes."""
        parts, rest = divmod(spp, self.part)
        layer = np.arange(self.layers, dtype=np.int64)
        taken = (parts - layer + self.layers - 1) // self.layers * self.part
        taken[parts % self.layers] += rest
        return np.repeat(taken, self.tiles)

    def least_spp(self, samples: NDArray[np.int64]) -> int:
        """Return the smallest spp whose samples include all these of the places."""
        parts, inside = np.divmod(samples - 1, self.part)
        layer = np.arange(self.places) // self.tiles
        last = (parts * self.layers + layer) * self.part + inside
        return int(np.where(samples > 0, last + 1, 0).max())

    def pieces(self, place: int, begin: int, end: int) -> Iterator[tuple[int, int]]:
        """Give the numbers that samples begin .. end - 1 of a place have in their pixel.

        A piece (first, end) stands for samples first .. end - 1 of each pixel of the tile.
        """
        layer = place // self.tiles
        while begin < end:
            part, inside = divmod(begin, self.part)
            count = min(self.part - inside, end - begin)
            first = (part * self.layers + layer) * self.part + inside
            yield first, first + count
            begin += count


# --------------------------------------------------------------------------------- film
# The film: sums in double precision, per tile, then per picture.
#
# Each tile has sums of its own, with a border as wide as the filter, and samples are
# added to them in their order; they are put together at the end, in a fixed order too. So
# nothing depends on which thread was first, and threads share no memory that they write
# to.

ALONE = 2**17  # pixels that one thread develops while others would start


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
    part : int
        Samples of a pixel that are traced together.

    Attributes
    ----------
    tiles : int64 (n, 5)
        What a `Tile` says of each: of the window and what lies beyond, row after row.
    sums : float64 (layers * tiles, channels + 1, rows, columns)
        Of each tile with its border, layer after layer; the last channel is the weight.
        Memory is taken when a tile is first written to.
    work : Work
        Which samples each of the sums takes.
    samples : int64 (places,)
        Samples that each of the sums holds. Together with `sums` they are the whole state
        of a render: another one with the same plan goes on from copies of both.
    pixels : int
        Pixels of all tiles.
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
        """Return a tile by its place in `tiles`."""
        return Tile(*self.tiles[number].tolist())

    @property
    def samples_done(self) -> int:
        """Samples that the film holds, of all pixels together."""
        return int(self.samples @ self.pixels_of_place)

    @property
    def spp(self) -> float:
        """Samples per pixel so far: their mean, where some tiles have more than others."""
        whole, rest = divmod(self.samples_done, self.pixels)
        return self.samples_done / self.pixels if rest else whole

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """The arrays from which another film goes on."""
        return {"sums": self.sums, "samples": self.samples}

    @property
    def has_separate_tiles(self) -> bool:
        """True if no pixel receives contributions of two sums."""
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

    def so_far(self) -> NDArray[np.float32]:
        """Return what `develop` does, while threads add samples.

        A tile may be seen between two of its samples, such as colour without its weight.
        """
        return self.develop()
