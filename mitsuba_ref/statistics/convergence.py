"""The exponent of RMSE against samples: -1/2 where samples are independent.

Two independent pictures of N samples per pixel differ by sqrt(2) standard errors, whatever
the truth is: no reference is needed. A slope nearer to 0 means correlated samples or a
variance that does not exist (fireflies); a steeper one means a stratified sampler. A bias
that both pictures share is not seen, one that depends on N is not seen either.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import rmse

INDEPENDENT = -0.5
TOLERANCE = 0.05
FEWEST_OCTAVES = 6
FEWEST_PAIRS = 8

Render = Callable[[int, int], NDArray[np.floating]]
"""Samples per pixel and a seed -> a picture."""


@dataclass(frozen=True)
class Convergence:
    """RMSE over doubling sample counts, and the slope in double logarithmic scale."""

    exponent: float
    standard_error: float  # of the exponent, from the scatter about the straight line
    samples: tuple[int, ...]
    rmse: tuple[float, ...]  # median over pairs

    @property
    def passed(self) -> bool:
        """Whether the samples behave as independent ones do."""
        return abs(self.exponent - INDEPENDENT) <= TOLERANCE


def measure_convergence(
    render: Render, samples: Sequence[int] = (1, 2, 4, 8, 16, 32, 64), pairs: int = 8
) -> Convergence:
    """Render 2 `pairs` pictures at each count, each with a seed of its own, and fit.

    The median over pairs: a firefly in one of them must not tilt the line.

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
    medians = []
    seed = 0
    for count in samples:
        errors = []
        for _ in range(pairs):
            errors.append(rmse(render(count, seed), render(count, seed + 1)))
            seed += 2
        medians.append(float(np.median(errors)))
    return fit(samples, medians)


def fit(samples: Sequence[int], errors: Sequence[float]) -> Convergence:
    """Return the least-squares slope of log error against log samples."""
    x, y = np.log(np.asarray(samples, float)), np.log(np.asarray(errors, float))
    x = x - x.mean()
    slope = float(np.sum(x * y) / np.sum(x**2))
    rest = y - y.mean() - slope * x
    scatter = float(np.sum(rest**2)) / (len(x) - 2)
    return Convergence(
        exponent=slope,
        standard_error=float(np.sqrt(scatter / np.sum(x**2))),
        samples=tuple(int(count) for count in samples),
        rmse=tuple(float(error) for error in errors),
    )
