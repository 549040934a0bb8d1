"""Films in bands, and films whose tiles are developed as soon as they are complete."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.film import TileGrid, compiled_development, develop_rows
from renderer.kernels.records.batch import TILE_SIZE
from renderer.process.worker_pool import in_threads
from renderer.rendering.film.film import SAMPLES_PER_JOB, Film

# --------------------------------------------------------------------------------- band
# A band is a part of the film that fits into memory: some rows of tiles.
#
# The sums of a tile have a border. So pixels at the edge of a band also need the rows of
# tiles next to it: those are passed on to the next band, and nothing is rendered twice. A
# band adds the same numbers in the same order as the whole film, so all bits are equal.


class FilmShape(NamedTuple):
    """Arguments of `Film`, see there."""

    channels: int
    x: int
    y: int
    width: int
    height: int
    border: int
    film_width: int
    beyond: int
    sums_in_all: int
    part: int = SAMPLES_PER_JOB

    @property
    def rows(self) -> int:
        """Number of rows of tiles."""
        return -(-(self.height + 2 * self.beyond) // TILE_SIZE)

    @property
    def columns(self) -> int:
        """Number of tiles in a row."""
        return -(-(self.width + 2 * self.beyond) // TILE_SIZE)

    @property
    def layers(self) -> int:
        """Number of sums of each tile."""
        return max(1, self.sums_in_all // (self.rows * self.columns))

    @property
    def carried(self) -> int:
        """Rows of tiles that a band passes on to the next."""
        return -(-2 * self.border // TILE_SIZE)

    @property
    def bytes_of_row(self) -> int:
        """Memory of the sums of a row of tiles [bytes]."""
        size = TILE_SIZE + 2 * self.border
        return 8 * self.layers * self.columns * (self.channels + 1) * size * size


class Band(Film):
    """Some rows of tiles of a film; `develop` returns the completed pixel rows.

    Parameters
    ----------
    shape : FilmShape
        The whole film.
    rows : int
        Rows of tiles, more than are passed on to the next band.
    first : int
        The first row of tiles.
    begin : int
        Rows of pixels that the previous bands have returned.
    """

    def __init__(self, shape: FilmShape, rows: int, first: int = 0, begin: int = 0) -> None:
        self._shape, self._rows, self._first = shape, rows, first
        last = min(first + rows, shape.rows)
        top = shape.y - shape.beyond + TILE_SIZE * first
        bottom = shape.y + shape.height + shape.beyond
        end = min(shape.y - shape.beyond + TILE_SIZE * last, bottom)
        part = shape._replace(
            y=top + shape.beyond,
            height=end - top - 2 * shape.beyond,
            sums_in_all=shape.layers * shape.columns * (last - first),
        )
        super().__init__(*part)
        self.begin, self.end = begin, shape.height
        if last < shape.rows:
            self.end = TILE_SIZE * last - shape.beyond - shape.border

    def develop(
        self, threads: int = 1, sums: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Return the rows of pixels begin .. end - 1 as `Film.develop` would."""
        sums = self.sums if sums is None else sums
        offset = TILE_SIZE * self._first
        first, end = self.begin - offset, self.end - offset
        channels = self.sums.shape[1] - 1
        picture = np.empty((end, self.width, channels), np.float32)

        def develop_part(part: int) -> None:
            start = first + part * TILE_SIZE
            develop_rows(sums, self.grid, picture, start, min(start + TILE_SIZE, end))

        in_threads(threads, -(-(end - first) // TILE_SIZE), develop_part)
        return picture[first:]

    def following(self) -> Band | None:
        """Return the next band, with the sums that both share; None after the last band.

        The sums of this band are no longer valid afterwards.
        """
        if self.end == self._shape.height:
            return None
        carried = self._shape.carried
        kept = self.grid.rows - carried
        band = Band(self._shape, self._rows, self._first + kept, self.end)
        band._by_rows(band.sums)[:, :carried] = self._by_rows(self.sums)[:, kept:]
        band._by_rows(band.samples)[:, :carried] = self._by_rows(self.samples)[:, kept:]
        self.sums = self.sums[:0]
        return band

    def _by_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return an array over places as (layers, rows, columns, ...)."""
        grid = self.grid
        return values.reshape(grid.layers, grid.rows, grid.columns, *values.shape[1:])


# ----------------------------------------------------------------------- finished tiles
# A picture whose tiles are developed as soon as all their samples are added.
#
# If the film's sums are not needed later, the sums of a tile need no permanent memory: each
# thread has sums for a strip of a few tiles, which stay in its cache. At 1920 x 1080 and
# one sample half of the time was spent on allocating 66 MB and on moving it through memory
# twice, and a sixth in Python code for each of 2040 tiles (docs/performance.md, "Once a
# picture").

MOST_BYTES = 512 << 10  # of a strip's sums: sixteen tiles of three channels
STRIPS_OF_A_THREAD = 16  # at least, if there are enough tiles, to balance the threads


class FinishedTiles(Film):
    """A film without sums; strips of neighbouring tiles are developed one at a time.

    Parameters
    ----------
    shape : FilmShape
        Shape of a film that `has_separate_tiles`.
    threads : int
        Number of threads that call `sums_of`, each with its own number.
    longest : int
        Largest number of tiles of a strip; it bounds the samples traced at once.

    Attributes
    ----------
    strips : list of (first, end)
        First and last + 1 tile of each strip; they are neighbours in one row.
    """

    def __init__(self, shape: FilmShape, threads: int, longest: int) -> None:
        super().__init__(*shape)
        self.compile()
        tiles, channels, *size = self.sums.shape
        # not zeros: one thread would write them while the others wait
        self._picture = np.empty((self.height, self.width, channels - 1), np.float32)
        self._lines = self._picture.reshape(self.height, self.width * (channels - 1))
        columns = self.grid.columns
        fitting = MOST_BYTES // self.sums[0].nbytes
        length = max(1, min(fitting, longest, tiles // (STRIPS_OF_A_THREAD * threads)))
        parts = -(-columns // length)
        cuts = [columns * part // parts for part in range(parts + 1)]
        self.strips = [
            (row + first, row + end)
            for row in range(0, tiles, columns)
            for first, end in itertools.pairwise(cuts)
        ]
        self._sums = [np.empty((length, channels, *size)) for _ in range(threads)]
        self._develop = compiled_development()

    def sums_of(self, strip: int, thread: int) -> NDArray[np.float64]:
        """Return zeroed sums for a thread that renders all samples of a strip."""
        first, end = self.strips[strip]
        sums = self._sums[thread][: end - first]
        sums[...] = 0.0
        return sums

    def finish(self, strip: int, sums: NDArray[np.float64]) -> None:
        """Write the tiles of a strip to the picture."""
        first, end = self.strips[strip]
        corner, last = self.tile(first), self.tile(end - 1)
        self._develop(
            sums.reshape(-1, sums.shape[-1]),
            TileGrid(1, end - first, 0, 0, 1),
            self._lines,
            np.empty((sums.shape[1], last.x + last.width - corner.x)),
            0,
            corner.height,
            corner.x - self.x,
            corner.y - self.y,
        )

    def develop(
        self, threads: int = 1, sums: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Return the picture (height, width, channels); unfinished tiles are black.

        No thread may be rendering.
        """
        for number in np.flatnonzero(self.samples == 0).tolist():
            tile = self.tile(number)
            x, y = tile.x - self.x, tile.y - self.y
            self._picture[y : y + tile.height, x : x + tile.width] = 0.0
        return self._picture

    def so_far(self) -> NDArray[np.float32]:
        """Return the picture while threads are rendering; unfinished tiles are black."""
        picture = np.zeros_like(self._picture)
        for number in np.flatnonzero(self.samples).tolist():
            tile = self.tile(number)
            x, y = tile.x - self.x, tile.y - self.y
            part = np.s_[y : y + tile.height, x : x + tile.width]
            picture[part] = self._picture[part]
        return picture
