"""Sources of samples for the tiles of a film: threads of this process, or a cluster.

The render loop starts a source, waits for it, and stops it before it reads the film.
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
    """Interface of an object that adds samples to a film."""

    begun: float  # `time.perf_counter()` of a start before the loop; else 0

    @property
    def note(self) -> str:
        """A line for the progress display; may be empty."""

    def start(self, wanted: NDArray[np.int64]) -> None:
        """Start adding samples until each place of the film holds `wanted` samples."""

    def wait(self) -> bool:
        """Wait for a short time; return true if all samples are there.

        Raises
        ------
        ClusterError
            If some samples can never be computed.
        """

    def stop(self) -> None:
        """Let the film be unchanged, with complete samples, until the next start."""

    def end(self) -> None:
        """Stop for good; samples that are nearly done may still be added before."""


class Threads:
    """Threads of this process, each of which takes one place of the film at a time.

    Parameters
    ----------
    job : RenderJob
        What is rendered.
    film : Film
        The film that they add samples to.
    """

    note = ""
    begun = 0.0

    def __init__(self, job: RenderJob, film: Film) -> None:
        self._job, self._film = job, film
        self._pool = WorkerPool(1, 0, lambda number, thread: None)

    def start(self, wanted: NDArray[np.int64]) -> None:
        """See `TileSource`; places may hold different numbers of samples before."""
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
        """Return threads that add one part to each place, then the next part."""
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
