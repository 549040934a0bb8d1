"""Where the tiles of a film get their samples: the threads of this process, or a cluster.

The render loop starts a source, waits for it, and stops it where the film must not change.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.process.worker_pool import WorkerPool
from renderer.rendering.film.band import FinishedTiles
from renderer.rendering.film.film import Film
from renderer.rendering.job import RenderJob


class TileSource(Protocol):
    """What adds samples to a film."""

    begun: float  # `time.perf_counter()` of a start ahead of the loop; else 0

    @property
    def note(self) -> str:
        """A line about what it does, for the progress; may be empty."""

    def start(self, wanted: NDArray[np.int64]) -> None:
        """Begin to add samples until each place of the film holds as many as wanted."""

    def wait(self) -> bool:
        """Wait for the end, but not for long; return true if all samples are there.

        Raises
        ------
        ClusterError
            If some will never be.
        """

    def stop(self) -> None:
        """Let the film be at rest, with whole samples, until the next start."""

    def end(self) -> None:
        """Stop for good; what is nearly done may still be added before."""


class Threads:
    """The threads of this process, which take one place of the film after the other.

    Parameters
    ----------
    job : RenderJob
        What they do.
    film : Film
        Where they add samples.
    """

    note = ""
    begun = 0.0

    def __init__(self, job: RenderJob, film: Film) -> None:
        self._job, self._film = job, film
        self._pool = WorkerPool(1, 0, lambda number, thread: None)

    def start(self, wanted: NDArray[np.int64]) -> None:
        """See `TileSource`; places may have come unequally far before."""
        if isinstance(self._film, FinishedTiles):
            self._pool = self._strips(self._film)
        else:
            self._pool = self._rounds(wanted)
        self._pool.start()

    def wait(self) -> bool:
        """See `TileSource`."""
        return self._pool.wait()

    def stop(self) -> None:
        """See `TileSource`."""
        self._pool.stop()

    def end(self) -> None:
        """See `TileSource`."""

    def _strips(self, film: FinishedTiles) -> WorkerPool:
        def work(strip: int, thread: int) -> None:
            self._job.finish_tiles(film, strip, thread)

        return WorkerPool(self._job.threads, len(film.strips), work)

    def _rounds(self, wanted: NDArray[np.int64]) -> WorkerPool:
        """Return threads that add one part to each place, then the next to each."""
        film = self._film
        places, part = film.work.places, film.work.part
        begun = film.samples // part
        missing = -(-wanted // part) - begun
        rounds = max(0, int(missing.max()))
        jobs = 0
        if rounds:
            jobs = (rounds - 1) * places + int(np.flatnonzero(missing == rounds)[-1]) + 1

        def work(number: int, thread: int) -> None:
            turn, place = divmod(number, places)
            end = min((begun[place] + turn + 1) * part, wanted[place])
            self._job.add_samples(film, place, int(end), thread)

        return WorkerPool(self._job.threads, jobs, work, round_length=places)
