"""The exponent of RMSE against samples: -1/2 where samples are independent.

Two independent pictures of N samples per pixel differ by sqrt(2) standard errors, whatever
the truth is: no reference is needed. A slope nearer to 0 means correlated samples or a
variance that does not exist (fireflies); a steeper one means a stratified sampler. A bias
that both pictures share is not seen, one that depends on N is not seen either.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mitsuba_ref.metrics.distances import rmse
from mitsuba_ref.statistics.hypothesis_tests.relabelling import SEED

INDEPENDENT = -0.5
TOLERANCE = 0.05
FALSE_ALARMS = 1e-3
SAMPLES = (1, 2, 4, 8, 16, 32, 64)
FEWEST_OCTAVES = 6
FEWEST_PAIRS = 8
MOST_PAIRS = 64
"""The Cornell box, whose worst noise is a few pixels at the lamp's edge, takes 32 or 64."""

MOST_PICTURES = 2 * MOST_PAIRS * len(SAMPLES)
"""Pictures of one measurement at `SAMPLES` at most, each with another seed."""

RESAMPLES = 2000

Render = Callable[[int, int], NDArray[np.floating]]
"""Samples per pixel and a seed -> a picture."""


@dataclass(frozen=True)
class Convergence:
    """RMSE over doubling sample counts, and the slope in double logarithmic scale."""

    exponent: float  # NaN where two pictures are equal, which have no noise
    standard_error: float  # of the exponent, by a bootstrap over pairs
    samples: tuple[int, ...]
    rmse: tuple[float, ...]  # median over pairs
    pairs: int  # of pictures, at each number of samples

    @property
    def degrees(self) -> int:
        """Degrees of freedom of the standard error."""
        return len(self.samples) * (self.pairs - 1)

    def beyond(self, alpha: float) -> float:
        """Return how far from the true exponent chance gets, but at the rate `alpha`."""
        return float(-special.stdtrit(self.degrees, alpha / 2.0)) * self.standard_error

    @property
    def limit(self) -> float:
        """How far from -0.5 the exponent may be: 0.05, and at least what chance does."""
        return max(TOLERANCE, self.beyond(FALSE_ALARMS))

    @property
    def p_value(self) -> float:
        """Of the measured distance from -0.5, were this the true exponent."""
        distance = abs(self.exponent - INDEPENDENT)
        if self.standard_error == 0.0:
            return float(distance == 0.0)
        t = distance / self.standard_error
        return 2.0 * float(special.stdtr(self.degrees, -t))

    @property
    def passed(self) -> bool:
        """Whether the samples behave as independent ones do."""
        return abs(self.exponent - INDEPENDENT) <= self.limit


def measure_convergence(
    render: Render, samples: Sequence[int] = SAMPLES, pairs: int = FEWEST_PAIRS
) -> Convergence:
    """Render 2 `pairs` pictures at each count, each with another seed, and fit.

    The median over pairs: a firefly in one of them must not tilt the line. Pairs are added,
    up to `MOST_PAIRS`, until 0.05 is further off than chance gets once in a thousand runs.

    Raises
    ------
    ValueError
        For fewer than six octaves or eight pairs, which cannot tell -0.5 from -0.45.
    """
    octaves = np.log2(max(samples) / min(samples))
    if octaves < FEWEST_OCTAVES or pairs < FEWEST_PAIRS:
        raise ValueError(
            f"{octaves:g} octaves and {pairs} pairs; {FEWEST_OCTAVES} octaves and "
            f"{FEWEST_PAIRS} pairs are needed"
        )
    errors: list[list[float]] = [[] for _ in samples]
    seed = 0
    while True:
        for count, found in zip(samples, errors, strict=True):
            while len(found) < pairs:
                found.append(rmse(render(count, seed), render(count, seed + 1)))
                seed += 2
        convergence = fit(samples, errors)
        if not convergence.limit > TOLERANCE or pairs >= MOST_PAIRS:
            return convergence
        pairs = min(2 * pairs, MOST_PAIRS)


def fit(samples: Sequence[int], errors: Sequence[Sequence[float]]) -> Convergence:
    """Return the least-squares slope of log median error against log samples.

    Parameters
    ----------
    samples
        Samples per pixel.
    errors
        For each of them the RMSE of as many pairs of pictures.
    """
    table = np.asarray(errors, float)
    medians = np.median(table, axis=1)
    x = np.log(np.asarray(samples, float))
    x = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    exponent = standard_error = math.nan
    if medians.min() > 0.0:
        exponent = float(x @ np.log(medians))
        # a rare pair without any difference, at few samples of sparse noise, has no log
        standard_error = _bootstrap(x, np.log(np.maximum(table, table[table > 0].min())))
    return Convergence(
        exponent=exponent,
        standard_error=standard_error,
        samples=tuple(int(count) for count in samples),
        rmse=tuple(float(error) for error in medians),
        pairs=table.shape[1],
    )


def _bootstrap(weights: NDArray[np.float64], logs: NDArray[np.float64]) -> float:
    """Draw pairs with replacement; return how much the slope of the medians scatters.

    The scatter about the straight line would be cheaper, but has five degrees of freedom:
    of 24 measured exponents one was 6.6 of such standard errors off -0.5. Of these it is
    1.9, and no other exponent is further off.
    """
    rng = np.random.default_rng(SEED)
    counts, pairs = logs.shape
    drawn = rng.integers(0, pairs, (RESAMPLES, counts, pairs))
    medians = np.median(np.take_along_axis(logs[None], drawn, axis=2), axis=2)
    return float(np.std(medians @ weights))
