"""A picture whose tiles are developed as soon as all their samples are there.

Where the film's sums are not needed again, those of a tile need no memory that lasts: each
thread has those of a strip's few tiles, which stay in its cache. At 1920 x 1080 and
one sample half of the time went into fetching 66 MB from the system and through memory
twice, and a sixth into Python for each of 2040 tiles (docs/performance.md, "Once a
picture").
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.film.develop import TileGrid, compiled_development
from renderer.rendering.film.band import FilmShape
from renderer.rendering.film.film import Film

MOST_BYTES = 512 << 10  # of a strip's sums: sixteen tiles of three channels
STRIPS_OF_A_THREAD = 16  # if there are so many tiles, so that threads end together


class FinishedTiles(Film):
    """A film without sums, whose tiles are developed a strip of neighbours at a time.

    Parameters
    ----------
    shape : FilmShape
        Of a film that `has_separate_tiles`.
    threads : int
        That call `sums_of`, each with a number of its own.
    longest : int
        The most tiles of a strip, for what their samples take.

    Attributes
    ----------
    strips : list of (first, end)
        The tiles of each strip, which are neighbours in one row.
    """

    def __init__(self, shape: FilmShape, threads: int, longest: int) -> None:
        super().__init__(*shape)
        self.compile()
        tiles, channels, *size = self.sums.shape
        # not zeros, which one thread would write while the others wait for it
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
        """Return empty sums, to which a thread adds all samples of the tiles of a strip."""
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
        """Return the picture (height, width, channels), black but for finished tiles.

        No thread may be at work.
        """
        for number in np.flatnonzero(self.samples == 0).tolist():
            tile = self.tile(number)
            x, y = tile.x - self.x, tile.y - self.y
            self._picture[y : y + tile.height, x : x + tile.width] = 0.0
        return self._picture
