"""The ladder of tests: from "the same size" to "the same noise", easy things first.

Each rung presumes those below: a shifted picture fails every test of radiance, and only
the rung that fails first says why. So the ladder stops at the first broken one. Rungs
under noise take K >= 8 pictures with independent seeds from each renderer.

What each rung assumes, sees and cannot see is in docs/statistics.md, with its false alarm
rate as measured by `false_alarms`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder import rungs_with_noise, rungs_without_noise
from mitsuba_ref.records.request import FEWEST_SEEDS
from mitsuba_ref.records.results import Rung
from mitsuba_ref.statistics.samples import stack

Array = NDArray[np.floating]

FALSE_ALARMS = 1e-3
"""Of each rung under noise; seven rungs make at most 7e-3 for the whole ladder."""


def climb(
    ours: Sequence[Array],
    theirs: Sequence[Array],
    our_aovs: Mapping[str, NDArray[np.float32]] | None = None,
    their_aovs: Mapping[str, NDArray[np.float32]] | None = None,
    deterministic: bool = False,
    *,
    alpha: float = FALSE_ALARMS,
    further: Sequence[Callable[[], Rung]] = (),
    to_the_top: bool = False,
    tell: Callable[[Rung], None] = lambda rung: None,
) -> list[Rung]:
    """Test two sets of pictures rung by rung; return the rungs up to the first broken one.

    Parameters
    ----------
    ours, theirs
        Pictures (H, W, 3) in linear sRGB, each with another seed, box filter. At least 8
        of each renderer; for a scene without noise one of ours and two of theirs.
    our_aovs, their_aovs
        As `compare_aovs` takes them; without theirs this rung is left out.
    deterministic
        The scene has no noise: its radiance is compared pixel by pixel, and the rungs
        about noise are left out.
    alpha
        False alarm rate of each rung under noise.
    further
        What makes the rungs above these (`scene_convergence`); called on arrival there.
    to_the_top
        Go on after a broken rung, to learn which of them see a defect. Pictures of
        different size or with NaN end the climb all the same.
    tell
        Gets each rung as soon as it is judged.

    Raises
    ------
    ValueError
        For too few pictures.
    """
    needed = (1, 2) if deterministic else (FEWEST_SEEDS, FEWEST_SEEDS)
    if len(ours) < needed[0] or len(theirs) < needed[1]:
        raise ValueError(
            f"{len(ours)} pictures of ours and {len(theirs)} of theirs; the ladder needs "
            f"{needed[0]} and {needed[1]}"
        )
    first = rungs_without_noise.finite(ours, theirs, our_aovs, their_aovs)
    climbed = [first]
    tell(first)
    if not first.passed:
        return climbed
    rungs = _rungs(ours, theirs, our_aovs, their_aovs, deterministic, alpha)
    for rung in itertools.chain(rungs, further):
        climbed.append(rung())
        tell(climbed[-1])
        if not (climbed[-1].passed or to_the_top):
            break
    return climbed


def _rungs(
    ours: Sequence[Array],
    theirs: Sequence[Array],
    our_aovs: Mapping[str, NDArray[np.float32]] | None,
    their_aovs: Mapping[str, NDArray[np.float32]] | None,
    deterministic: bool,
    alpha: float,
) -> Iterator[Callable[[], Rung]]:
    """Yield what makes each rung, in order; nothing is computed before it is called."""
    # One picture without noise counts as two that are equal: a variance of zero.
    a, b = stack([*ours, ours[0]] if deterministic else ours), stack(theirs)
    yield lambda: rungs_with_noise.registration(a, b, alpha, deterministic)
    if their_aovs is not None:
        yield lambda: rungs_without_noise.aovs(our_aovs or {}, their_aovs)
    if deterministic:
        yield lambda: rungs_without_noise.radiance(ours[0], theirs, their_aovs)
        return
    for name in rungs_with_noise.WELCH:
        yield partial(rungs_with_noise.welch, name, a, b, alpha)
    yield partial(rungs_with_noise.uniformity, a, b, alpha)
    yield partial(rungs_with_noise.noise_free, a, b, alpha)
    yield partial(rungs_with_noise.floors, a, b, alpha)
