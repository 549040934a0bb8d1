"""A picture whose tiles are developed one by one, as soon as all their samples are there.

Where nobody asks for the film's sums again, the sums of a tile need no memory that lasts:
each thread has those of one tile, which stay in its cache. At 1920 x 1080 and one sample
half of the time went into fetching 66 MB from the system and through memory twice
(docs/performance.md, "Once a picture").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.stages.film import Film, TileGrid, compiled_development


class FinishedTiles:
    """The picture of a film, tile by tile; its other pixels are black as yet.

    Parameters
    ----------
    film : Film
        That `has_separate_tiles`; its sums are left alone.
    threads : int
        That call `sums` and `finish`, each with a number of its own.
    """

    def __init__(self, film: Film, threads: int) -> None:
        self._film = film
        _, rows, *size = film.sums.shape
        self.picture = np.zeros((film.height, film.width, rows - 1), np.float32)
        self._lines = self.picture.reshape(film.height, film.width * (rows - 1))
        self._sums = [np.empty((rows, *size), film.sums.dtype) for _ in range(threads)]
        self._develop = compiled_development()

    def sums(self, thread: int) -> NDArray[np.float64]:
        """Return empty sums, to which a thread adds all samples of a tile."""
        sums = self._sums[thread]
        sums[...] = 0.0
        return sums

    def finish(self, tile: int, thread: int) -> None:
        """Write a tile of the picture from the thread's sums."""
        sums, where = self._sums[thread], self._film.tiles[tile]
        self._develop(
            sums.reshape(-1, sums.shape[-1]),
            TileGrid(1, 1, 0, 0, 1),
            self._lines,
            np.empty((len(sums), where.width)),
            0,
            where.height,
            where.x - self._film.x,
            where.y - self._film.y,
        )
