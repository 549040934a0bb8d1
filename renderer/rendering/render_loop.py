"""The render loop: adds samples to tiles until the film is complete or a goal is reached.

Threads and clusters are sources of tiles (`tile_sources`); the loop treats them the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ClusterError, SceneError
from renderer.integrators.kind import Shown
from renderer.rendering.accuracy import Accuracy
from renderer.rendering.checkpoints.checkpoint import Checkpoint
from renderer.rendering.film.film import Film
from renderer.rendering.goal import Goal, Halves
from renderer.rendering.job import RenderJob
from renderer.rendering.progress_display import Progress
from renderer.rendering.render_options import MOST_SAMPLES
from renderer.rendering.tile_sources import Threads, TileSource


class Outcome(NamedTuple):
    """Result of a loop; the samples are in its film."""

    complete: bool  # false after an interrupt, or if a cluster was lost
    seconds: float  # [s] of tracing, including the time before a checkpoint
    trouble: str = ""  # the error of a cluster that ended the loop
    has_goal: bool = False
    accuracy: Accuracy | None = None  # known if the goal needs it


def run(
    job: RenderJob,
    film: Film,
    source: TileSource | None = None,
    *,
    goal: Goal | None = None,
    checkpoint: Checkpoint | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Outcome:
    """Add the samples of a job to a film, until it is complete or interrupted.

    An interrupt (Ctrl-C) ends the loop after the tiles in progress. A second interrupt
    before these tiles end is raised.

    Parameters
    ----------
    job : RenderJob
        What is rendered.
    film : Film
        The samples so far; the loop adds the missing ones.
    source : TileSource, optional
        Adds the samples; None: threads of this process.
    goal : Goal, optional
        Ends the loop early; it ends at the latest with the plan's samples.
    checkpoint : Checkpoint, optional
        The film is first filled from it; then the state is saved to it.
    progress : callable, optional
        Called with a `Progress`, in the calling thread.

    Raises
    ------
    SceneError
        If the checkpoint is not valid for this film.
    """
    return RenderLoop(job, film, source, goal, checkpoint, progress).run()


class RenderLoop:
    """The state of one call of `run`."""

    def __init__(
        self,
        job: RenderJob,
        film: Film,
        source: TileSource | None = None,
        goal: Goal | None = None,
        checkpoint: Checkpoint | None = None,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        self._job, self._film, self._progress = job, film, progress
        self._source: TileSource = Threads(job, film) if source is None else source
        self._checkpoint = checkpoint
        self._goal = None if job.plan.spp == 1 else goal
        self._halves = None if self._goal is None else Halves(film)
        self._accuracy: Accuracy | None = None
        self._at_work = False  # whether the source may be adding samples
        self._start = self._origin = self._source.begun or time.perf_counter()
        self._resumed = 0  # samples from the checkpoint

    def run(self) -> Outcome:
        """See the function `run`."""
        checkpoint, trouble = self._checkpoint, ""
        complete = False
        try:
            if checkpoint is not None:
                self._go_on_from(checkpoint)
                self._resumed = self._film.samples_done
            self._show()
            if self._goal is None or self._halves is None:
                self._trace(self._job.plan.spp)
            else:
                self._trace_until(self._goal, self._halves)
            if checkpoint is not None:
                checkpoint.save(self._state)
            self._show()
            complete = True
        except KeyboardInterrupt:
            if self._at_work:  # a second interrupt, before the tiles in progress end
                raise
        except ClusterError as error:
            trouble = str(error)
        finally:
            self._source.end()
            if checkpoint is not None:
                checkpoint.close()
        has_goal = self._goal is not None
        return Outcome(complete, self._seconds, trouble, has_goal, self._accuracy)

    @property
    def _seconds(self) -> float:
        """Return the seconds of this loop and of those before its checkpoint."""
        return time.perf_counter() - self._origin

    @property
    def _state(self) -> dict[str, NDArray[Any]]:
        state = self._film.state | self._job.state | {"seconds": np.array([self._seconds])}
        return state if self._halves is None else state | self._halves.state

    def _show(self) -> None:
        if self._progress is None:
            return
        total, error = self._film.pixels * self._job.plan.spp, None
        if self._goal is not None:
            total, error = self._expected(self._goal)
        done, seconds = self._film.samples_done, time.perf_counter() - self._start
        note, picture = self._source.note, self._picture
        self._progress(
            Progress("render", done, total, seconds, error, self._resumed, note, picture)
        )

    def _picture(self) -> Shown:
        return self._job.shown(self._film.so_far())

    def _go_on_from(self, checkpoint: Checkpoint) -> None:
        state = self._state
        if not checkpoint.restore(state):
            return
        seconds, samples = float(state["seconds"][0]), self._film.samples
        halves, spp = self._halves, self._job.plan.spp
        if not 0.0 <= seconds < float("inf"):
            raise SceneError(f"the checkpoint is of {seconds} seconds")
        if samples.min() < 0:
            raise SceneError("the checkpoint has places with less than no samples")
        if halves is not None and not 0 <= halves.done <= halves.end:
            raise SceneError(
                f"the checkpoint's next look, at {halves.end} samples, is before the last, "
                f"at {halves.done}"
            )
        end = 0 if halves is None else halves.end
        work = self._film.work
        if end > spp or (samples > work.samples(spp)).any():
            # clipped, so that the product below does not overflow 64 bits
            plausible = np.minimum(samples, MOST_SAMPLES + 1)
            raise SceneError(
                f"spp is {spp}, and the checkpoint has samples up to "
                f"{max(end, work.least_spp(plausible))}; so many or more are possible"
            )
        self._origin -= seconds
        if halves is not None:
            self._accuracy = halves.last_look(self._job.threads)

    def _trace_until(self, goal: Goal, halves: Halves) -> None:
        while True:
            if halves.end == halves.done:
                more = self._next_samples(goal, halves.done)
                if more == 0:
                    return
                halves.begin(more)
            if not halves.in_second:
                self._trace(halves.middle)
                halves.end_first()
            self._trace(halves.end)
            self._accuracy = halves.end_second(self._job.threads)

    def _next_samples(self, goal: Goal, done: int) -> int:
        accuracy, most = self._accuracy, self._job.plan.spp
        error, steady = float("inf"), False
        if accuracy is not None:
            error, steady = accuracy.error, accuracy.steady
        return goal.next_samples(done, error, self._seconds, most, steady=steady)

    def _expected(self, goal: Goal) -> tuple[int, float]:
        """Return the expected number of samples, and the error of the present ones."""
        accuracy, most = self._accuracy, self._job.plan.spp
        if accuracy is None:
            return self._film.pixels * most, float("inf")
        done, error = accuracy.samples, accuracy.error
        spp = goal.expected_samples(done, error, self._seconds, most)
        return max(spp * self._film.pixels, self._film.samples_done), error

    def _trace(self, end_sample: int) -> None:
        """Add the missing ones of samples 0 .. end_sample - 1 to all pixels.

        The source is stopped while a checkpoint is copied.
        """
        checkpoint = self._checkpoint
        try:
            while not self._trace_till_due(end_sample):
                assert checkpoint is not None
                checkpoint.take(self._state)
        except (KeyboardInterrupt, ClusterError):
            if not self._at_work:
                self._at_work = True
                self._source.end()
                self._at_work = False
                if checkpoint is not None:
                    checkpoint.save(self._state)
            raise

    def _trace_till_due(self, end_sample: int) -> bool:
        """Trace until a checkpoint is due; return true if no sample is missing."""
        source, checkpoint = self._source, self._checkpoint
        self._at_work = True
        try:
            source.start(self._film.work.samples(end_sample))
            while not source.wait():
                self._show()
                if checkpoint is not None and checkpoint.due():
                    return False
            return True
        finally:
            source.stop()
            self._at_work = False
