"""Measuring in turn, and the check that must come first: do the pictures agree at all."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]

# Standard errors. With 8 seeds a side (Student's t, 14 degrees of freedom) three honest
# channels exceed it once in some two thousand runs; a missing bounce does by hundreds.
LIMIT = 5.0

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
    first: Rgb
    second: Rgb

    @property
    def passed(self) -> bool:
        """Whether no channel differs by more than `LIMIT` standard errors."""
        return all(abs(z) <= LIMIT for z in self.z)  # not `max`: it may skip a NaN


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
    difference = one.mean(axis=0) - two.mean(axis=0)
    error = np.sqrt((one.var(axis=0, ddof=1) + two.var(axis=0, ddof=1)) / len(seeds))
    floor = ROUNDING * np.abs(two.mean(axis=0)) + np.finfo(np.float32).tiny
    z = difference / np.maximum(error, floor)
    return MeansCompared(_rgb(z), _rgb(one.mean(axis=0)), _rgb(two.mean(axis=0)))


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
