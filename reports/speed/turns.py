"""Measuring in turn, and the check that must come first: do the pictures agree at all."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t, sidak_p, welch
from reports.speed.record import MeanCheck

Rgb = tuple[float, float, float]

# Of one comparison, all three channels together. `make charts` makes some 350: one right
# contender is stopped in a hundred runs. Five standard errors, whatever the degrees of
# freedom, would be 0.2 % of a comparison where the judge alone is noisy (8 seeds, 7
# degrees), and one in two runs.
ALPHA = 3e-5

# Two float32 renders of the same noiseless scene differ by rounding alone.
ROUNDING = 1e-5


@dataclass(frozen=True)
class Render:
    """What a contender says about one render."""

    seconds: float
    mean: Rgb  # of all pixels, linear sRGB


Contender = Callable[[int, int], Render]
"""Renders with (seed, samples per pixel), warm."""


@dataclass(frozen=True)
class MeansCompared:
    """Image means of two contenders over several seeds."""

    z: Rgb  # difference in standard errors
    limit: float  # of |z|, by Welch's test: it hangs on whose noise it is
    p: float  # of the three channels together
    first: Rgb
    second: Rgb

    def record(self, seeds: int, spp: int) -> MeanCheck:
        """Return it as records of measurements keep it; the second is the reference."""
        return MeanCheck(
            passed=self.passed,
            seeds=seeds,
            spp=spp,
            z=self.z,
            limit=self.limit,
            ours_mean=self.first,
            reference_mean=self.second,
        )

    @property
    def passed(self) -> bool:
        """Whether right contenders differ as much more often than `ALPHA`."""
        return self.p >= ALPHA and bool(np.isfinite((self.first, self.second)).all())


def compare_means(
    first: Contender, second: Contender, seeds: Sequence[int], spp: int
) -> MeansCompared:
    """Render with both over all seeds and compare the image means.

    The standard error comes from the spread over seeds, never over pixels: a
    reconstruction filter makes neighbouring pixels depend on one another.

    Parameters
    ----------
    first, second
        Contenders; they get different seeds, so that no random numbers are shared.
    seeds
        At least two.
    spp
        Samples per pixel of each render.
    """
    offset = max(seeds) + 1
    one = np.array([first(seed, spp).mean for seed in seeds])
    two = np.array([second(seed + offset, spp).mean for seed in seeds])
    result = welch(one, two, ROUNDING)
    return MeansCompared(
        _rgb(result.t),
        critical_t(ALPHA, result.p.size, float(np.min(result.degrees))),
        sidak_p(float(np.min(result.p)), result.p.size),
        _rgb(one.mean(axis=0)),
        _rgb(two.mean(axis=0)),
    )


def take_turns(
    contenders: Mapping[str, Contender],
    rounds: int,
    spp: int,
    progress: Callable[[str], None] = lambda stage: None,
) -> dict[str, list[float]]:
    """Return the seconds of each contender, one a round, all taking a turn in each round.

    What disturbs the machine for a while then disturbs all of them alike, and a ratio
    formed within a round stands.
    """
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(rounds):
        for name, contender in contenders.items():
            progress(f"round {turn + 1} of {rounds}: {name}")
            seconds[name].append(contender(turn, spp).seconds)
    return seconds


def _rgb(values: NDArray[np.float64]) -> Rgb:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
