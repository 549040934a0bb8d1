"""Stopping rules of a render: an error, a time, or a number of samples.

A render stops only between whole passes over the picture, so the result is bit by bit the
picture for this number of samples. The rules add little bias: there are few checks of the
error (each after at least a tenth more samples, unless the time is up), and the difference
of two halves, which is checked, is nearly independent of their mean (`accuracy`).
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from renderer.errors import SceneError
from renderer.rendering.accuracy import Accuracy, estimate
from renderer.rendering.film.film import Film
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene

MOST_BY_DEFAULT = 1 << 20  # samples per pixel if `spp` is not given
OPEN_ENDED = ("independent",)  # samplers whose first n points do not depend on n
ENOUGH = 256  # samples from which an error that few pixels dominate is accepted
FIRST_LOOK = 16  # samples before the first check
MOST_AT_ONCE = 3.0  # largest number of new samples before a check, relative to the old
LEAST_AT_ONCE = 0.1
SHORT_OF = 0.9  # times the samples that seem to be missing, to avoid too many


class Goal(NamedTuple):
    """Conditions that end a render before its number of samples; None: no condition."""

    target_error: float | None = None  # relative, see `accuracy`
    time_limit: float | None = None  # [s] of rendering

    def next_samples(
        self, done: int, error: float, seconds: float, most: int, *, steady: bool = True
    ) -> int:
        """Return the number of samples to add now, an even number; 0 ends the render.

        `done` samples took `seconds` and left `error`; `steady` is false if few pixels
        dominate it. `most` is the largest total number of samples.
        """
        if done == 0:
            return min(FIRST_LOOK if self.time_limit is None else 2, most // 2 * 2)
        wanted = MOST_AT_ONCE * done
        if self.target_error is not None:
            if error <= self.target_error and (steady or done >= ENOUGH):
                return 0
            missing = done * (error / self.target_error) ** 2 - done
            wanted = min(wanted, max(SHORT_OF * missing, LEAST_AT_ONCE * done, 2.0))
        if self.time_limit is not None:
            left = self.time_limit - seconds
            wanted = min(wanted, left * done / max(seconds, 1e-6))
        return max(0, int(min(wanted, most - done)) // 2 * 2)

    def expected_samples(self, done: int, error: float, seconds: float, most: int) -> int:
        """Return the expected total number of samples."""
        expected = float(most)
        if done and self.target_error is not None:
            expected = min(expected, done * max(1.0, (error / self.target_error) ** 2))
        if done and self.time_limit is not None:
            expected = min(expected, done * self.time_limit / max(seconds, 1e-6))
        return max(done, int(expected))


def options_of_goal(scene: Scene, options: RenderOptions) -> RenderOptions:
    """Return options with the sampler and the maximum samples for a goal, if there is one.

    Raises
    ------
    SceneError
        If the samples cannot be divided into two halves.
    """
    if not options.has_goal:
        return options
    sampler, spp = options.sampler, options.spp
    if spp is None:
        spp = MOST_BY_DEFAULT
    elif spp < 2:
        raise SceneError(f"spp is {spp}; a goal needs 2 samples or more, in two halves")
    if sampler is None and scene.description.camera.sampler.name not in OPEN_ENDED:
        sampler = OPEN_ENDED[0]
    return dataclasses.replace(options, sampler=sampler, spp=spp)


def goal_of(options: RenderOptions, plan: Plan) -> Goal | None:
    """Return the goal of a render; refuse renders whose error cannot be estimated.

    Raises
    ------
    SceneError
        For channels other than colours, replays, and samplers with a fixed pattern.
    """
    if not options.has_goal:
        return None
    if plan.moments is not None:
        raise SceneError("a goal needs a picture of colours alone, and `moment` gives more")
    if plan.kind.channels != 3 or plan.kind.counts_work:
        raise SceneError(
            f"a goal needs a picture of colours alone, and {plan.method!r} gives other "
            "channels; possible is --integrator path"
        )
    if plan.sampler_name not in OPEN_ENDED:
        raise SceneError(
            f"the points of the sampler {plan.sampler_name!r} depend on how many there "
            "are, which is not known before the goal is reached; possible is --sampler "
            + " or ".join(OPEN_ENDED)
        )
    error = options.target_error
    return Goal(None if error is None else float(error), options.time_limit)


class Halves:
    """The film's sums in two halves of equally many samples, and the next check.

    Attributes
    ----------
    state : dict of str to array
        All state in addition to the film's sums; checkpoints store it.
    """

    def __init__(self, film: Film) -> None:
        self._film = film
        self._first = np.zeros_like(film.sums)
        self._before = film.sums.copy()
        # samples of each pixel at the last check and at the next one, and whether its
        # second half has begun
        self._looks = np.zeros(3, np.int64)
        self.state = {
            "first half": self._first,
            "sums before": self._before,
            "looks": self._looks,
        }

    @property
    def done(self) -> int:
        """Samples of each pixel at the last check."""
        return int(self._looks[0])

    @property
    def end(self) -> int:
        """Samples of each pixel at the next check; equal to `done` if none is planned."""
        return int(self._looks[1])

    @property
    def middle(self) -> int:
        """Samples of each pixel at which the second half of the next check begins."""
        return (self.done + self.end) // 2

    @property
    def in_second(self) -> bool:
        """Whether the second half has begun."""
        return bool(self._looks[2])

    def begin(self, more: int) -> None:
        """Set the next check."""
        self._looks[1] = self.done + more

    def end_first(self) -> None:
        """Add the samples since the last check to the first half."""
        np.subtract(self._film.sums, self._before, out=self._before)
        self._first += self._before
        self._looks[2] = 1

    def end_second(self, threads: int) -> Accuracy:
        """Add the samples since then to the second half; return the estimated error."""
        self._before[:] = self._film.sums
        self._looks[:] = self.end, self.end, 0
        accuracy = self.last_look(threads)
        assert accuracy is not None
        return accuracy

    def last_look(self, threads: int) -> Accuracy | None:
        """Return the error of the last check; None without a stored one."""
        if self.in_second or self.done == 0:
            return None
        first = self._film.develop(threads, self._first)
        second = self._film.develop(threads, self._before - self._first)
        return estimate(first, second, self.done)
