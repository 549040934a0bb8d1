"""When a render has enough samples: at an error, at a time, or at a number of them.

It stops between whole passes over the picture only, so what comes out is the picture that
this number of samples gives, bit for bit. What a stopping rule could bias it by: looks are
few (each adds at least a tenth, but where the time is up) and what is looked at, the
difference of two halves, hardly depends on their mean (`accuracy`).
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

MOST_BY_DEFAULT = 1 << 20  # samples per pixel where `spp` is not given
OPEN_ENDED = ("independent",)  # samplers whose first n points do not depend on n
ENOUGH = 256  # samples, after which an error is believed that few pixels decide
FIRST_LOOK = 16  # samples
MOST_AT_ONCE = 3.0  # times those that are done, before the next look
LEAST_AT_ONCE = 0.1
SHORT_OF = 0.9  # of what seems to be missing: better a look more than samples too many


class Goal(NamedTuple):
    """What ends a render before its number of samples is reached; None: not this."""

    target_error: float | None = None  # relative, see `accuracy`
    time_limit: float | None = None  # [s] of rendering

    def next_samples(
        self, done: int, error: float, seconds: float, most: int, *, steady: bool = True
    ) -> int:
        """Return how many samples to add now, an even number; 0 is the end.

        `done` samples took `seconds` and left `error`, of which few pixels decide if it is
        not `steady`; there may be `most` samples in all.
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
        """Return how many samples there will probably be in all."""
        expected = float(most)
        if done and self.target_error is not None:
            expected = min(expected, done * max(1.0, (error / self.target_error) ** 2))
        if done and self.time_limit is not None:
            expected = min(expected, done * self.time_limit / max(seconds, 1e-6))
        return max(done, int(expected))


def options_of_goal(scene: Scene, options: RenderOptions) -> RenderOptions:
    """Return options with the sampler and the most samples of a goal, if they have one.

    Raises
    ------
    SceneError
        If there can be no two halves.
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
    """Return the goal of a render; refuse what has no error, or a fixed pattern of points.

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
    """The film's sums so far in two halves of equally many samples, and the next look.

    Attributes
    ----------
    state : dict of str to array
        All that there is to know in addition to the film's sums, to be kept with these.
    """

    def __init__(self, film: Film) -> None:
        self._film = film
        self._first = np.zeros_like(film.sums)
        self._before = film.sums.copy()
        # samples of each pixel at the last look and at the next, and whether its second
        # half has begun
        self._looks = np.zeros(3, np.int64)
        self.state = {
            "first half": self._first,
            "sums before": self._before,
            "looks": self._looks,
        }

    @property
    def done(self) -> int:
        """Samples of each pixel at the last look."""
        return int(self._looks[0])

    @property
    def end(self) -> int:
        """Samples of each pixel at the next look; those at the last until there is one."""
        return int(self._looks[1])

    @property
    def middle(self) -> int:
        """Samples of each pixel at which the next look's second half begins."""
        return (self.done + self.end) // 2

    @property
    def in_second(self) -> bool:
        """Whether it has begun."""
        return bool(self._looks[2])

    def begin(self, more: int) -> None:
        """Set the next look."""
        self._looks[1] = self.done + more

    def end_first(self) -> None:
        """Count what was added since the last look to the first half."""
        np.subtract(self._film.sums, self._before, out=self._before)
        self._first += self._before
        self._looks[2] = 1

    def end_second(self, threads: int) -> Accuracy:
        """Count what was added since then to the second; return what both say."""
        self._before[:] = self._film.sums
        self._looks[:] = self.end, self.end, 0
        accuracy = self.last_look(threads)
        assert accuracy is not None
        return accuracy

    def last_look(self, threads: int) -> Accuracy | None:
        """Return what the last look said; None if it is not known any more, or yet."""
        if self.in_second or self.done == 0:
            return None
        first = self._film.develop(threads, self._first)
        second = self._film.develop(threads, self._before - self._first)
        return estimate(first, second, self.done)
