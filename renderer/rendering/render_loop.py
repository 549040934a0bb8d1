"""One sitting of a render: threads trace what is missing; an interrupt keeps the rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ClusterError, SceneError
from renderer.process.worker_pool import WorkerPool
from renderer.rendering.checkpoints.checkpoint import Checkpoint
from renderer.rendering.goal import Goal, Halves
from renderer.rendering.options import MOST_SAMPLES
from renderer.rendering.progress_display import Progress
from renderer.rendering.rendering import Rendering

if TYPE_CHECKING:  # needs Dask, an extra
    from renderer.rendering.cluster.team import ClusterScheduler


class RenderLoop:
    """Traces from where a rendering is, or its checkpoint, to the end or to a goal.

    Parameters
    ----------
    rendering : Rendering
        What there is so far; it holds what is traced.
    progress : callable, optional
        Called with a `Progress`, in the calling thread.
    goal : Goal, optional
        At which it ends, at the latest with the plan's samples.
    checkpoint : Checkpoint, optional
        From which it goes on, and that keeps the state.
    team : ClusterScheduler, optional
        Workers of a cluster that trace in place of threads.
    """

    def __init__(
        self,
        rendering: Rendering,
        progress: Callable[[Progress], None] | None = None,
        goal: Goal | None = None,
        checkpoint: Checkpoint | None = None,
        team: ClusterScheduler | None = None,
    ) -> None:
        self._rendering, self._progress = rendering, progress
        self._checkpoint, self._team = checkpoint, team
        assert rendering.without_sums is None or (goal, checkpoint, team) == (None,) * 3
        self._goal = None if rendering.plan.spp == 1 else goal
        self._halves = None if self._goal is None else Halves(rendering.film)
        rendering.has_goal = self._goal is not None
        self._at_work = False  # threads are, or may be
        self._start = self._origin = rendering.begun or time.perf_counter()
        self._resumed = 0  # samples

    def run(self) -> bool:
        """Trace; return whether it went to the end. What stopped it is in `trouble`.

        An interrupt (Ctrl-C) ends the render after the jobs that are under way; one more
        while these end is raised.

        Raises
        ------
        SceneError
            If the checkpoint does not fit.
        """
        rendering, checkpoint = self._rendering, self._checkpoint
        if checkpoint is not None:
            self._go_on_from(checkpoint)
            self._resumed = rendering.samples_done
        try:
            self._show()
            if self._goal is None or self._halves is None:
                self._trace(rendering.plan.spp)
            else:
                self._trace_until(self._goal, self._halves)
            if checkpoint is not None:
                checkpoint.save(self._state)
            self._show()
        except KeyboardInterrupt:
            if self._at_work:  # one more, while they end what they are at
                raise
            return False
        except ClusterError as error:
            rendering.trouble = str(error)
            return False
        finally:
            rendering.seconds = self._seconds
            if checkpoint is not None:
                checkpoint.close()
        return True

    @property
    def _seconds(self) -> float:
        """Of this sitting and those before it."""
        return time.perf_counter() - self._origin

    @property
    def _state(self) -> dict[str, NDArray[Any]]:
        state = self._rendering.state | {"seconds": np.array([self._seconds])}
        return state if self._halves is None else state | self._halves.state

    def _show(self) -> None:
        if self._progress is None:
            return
        rendering = self._rendering
        total, error = rendering.samples_in_all, None
        if self._goal is not None:
            total, error = self._expected(self._goal)
        done, seconds = rendering.samples_done, time.perf_counter() - self._start
        note = "" if self._team is None else self._team.note
        self._progress(Progress("render", done, total, seconds, error, self._resumed, note))

    def _go_on_from(self, checkpoint: Checkpoint) -> None:
        rendering, state = self._rendering, self._state
        if not checkpoint.restore(state):
            return
        seconds, samples = float(state["seconds"][0]), rendering.samples_of_place
        halves, spp = self._halves, rendering.plan.spp
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
        if end > spp or (samples > rendering.work.samples(spp)).any():
            # no larger ones, whose product would not be a number of 64 bits
            plausible = np.minimum(samples, MOST_SAMPLES + 1)
            raise SceneError(
                f"spp is {spp}, and the checkpoint has samples up to "
                f"{max(end, rendering.work.least_spp(plausible))}; so many or more are "
                "possible"
            )
        self._origin -= seconds
        if halves is not None:
            rendering.accuracy = halves.last_look(rendering.threads)

    def _trace_until(self, goal: Goal, halves: Halves) -> None:
        rendering = self._rendering
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
            rendering.accuracy = halves.end_second(rendering.threads)

    def _next_samples(self, goal: Goal, done: int) -> int:
        accuracy, most = self._rendering.accuracy, self._rendering.plan.spp
        error, steady = float("inf"), False
        if accuracy is not None:
            error, steady = accuracy.error, accuracy.steady
        return goal.next_samples(done, error, self._seconds, most, steady=steady)

    def _expected(self, goal: Goal) -> tuple[int, float]:
        """Return how many samples there will be, and the error of those that there are."""
        rendering, accuracy = self._rendering, self._rendering.accuracy
        if accuracy is None:
            return rendering.samples_in_all, float("inf")
        done, error = accuracy.samples, accuracy.error
        spp = goal.expected_samples(done, error, self._seconds, rendering.plan.spp)
        return max(spp * rendering.pixels, rendering.samples_done), error

    def _trace(self, end_sample: int) -> None:
        """Add what is missing of samples 0 .. end_sample - 1 of all pixels.

        A checkpoint is taken between two crews, when nobody writes to the sums.
        """
        checkpoint = self._checkpoint
        try:
            while not self._trace_till_due(end_sample):
                assert checkpoint is not None
                checkpoint.take(self._state)
        except (KeyboardInterrupt, ClusterError):
            if checkpoint is not None and not self._at_work:
                checkpoint.save(self._state)
            raise

    def _trace_till_due(self, end_sample: int) -> bool:
        """Trace until a checkpoint is due; return true if nothing is missing any more.

        Places may have come unequally far.
        """
        rendering = self._rendering
        if rendering.without_sums is not None:
            strips = len(rendering.without_sums.strips)
            return self._work_off(
                WorkerPool(rendering.threads, strips, rendering.finish_tiles)
            )
        places, part = rendering.work.places, rendering.work.part
        wanted = rendering.work.samples(end_sample)
        if self._team is not None:
            self._trace_by(self._team, wanted)
            return True
        begun = rendering.samples_of_place // part
        missing = -(-wanted // part) - begun
        rounds = int(missing.max())
        if rounds <= 0:
            return True
        jobs = (rounds - 1) * places + int(np.flatnonzero(missing == rounds)[-1]) + 1

        def work(job: int, thread: int) -> None:
            number, place = divmod(job, places)
            end = min((begun[place] + number + 1) * part, wanted[place])
            rendering.add_samples(place, int(end), thread)

        crew = WorkerPool(rendering.threads, jobs, work, round_length=places)
        return self._work_off(crew)

    def _work_off(self, crew: WorkerPool) -> bool:
        """Let a crew do its jobs till a checkpoint is due; return true if all are done."""
        checkpoint = self._checkpoint
        self._at_work = True
        try:
            crew.start()
            while not crew.wait():
                self._show()
                if checkpoint is not None and checkpoint.due():
                    return False
            return True
        finally:
            crew.stop()
            self._at_work = False

    def _trace_by(self, team: ClusterScheduler, wanted: NDArray[np.int64]) -> None:
        """Let a cluster's workers trace all that is missing."""
        rendering, checkpoint = self._rendering, self._checkpoint
        kept = rendering.samples_done  # in the checkpoint

        def look() -> None:
            nonlocal kept
            self._show()
            done = rendering.samples_done
            if checkpoint is not None and done > kept and checkpoint.due():
                team.meanwhile(lambda: checkpoint.take(self._state))
                kept = done

        self._at_work = True
        try:
            team.trace(rendering, wanted, look)
        finally:
            team.end(rendering)
            self._at_work = False
