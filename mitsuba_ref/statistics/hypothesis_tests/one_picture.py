"""One picture of ours against several of Mitsuba's: a bias in noise of unknown shape.

With one picture on our side Welch's test (`welch`) has no variance to take. But under the
hypothesis "ours is one more picture of Mitsuba's, with another seed" the values of a pixel
are exchangeable, and pixels are independent (box filter). So for each pixel, with k over
ours and the S references, d_k = x_k - mean of the others has mean zero, and v = mean_k
d_k^2 is its variance over all relabellings (`relabelling`): no assumption about the shape
of the noise, and a firefly raises its own variance. With D and V the sums of d and v over n
pixels, D / sqrt(V) has variance 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.distances import TILE, tile_sums
from mitsuba_ref.statistics.samples import ROUNDING, Floats, stack, standard_errors

MEAN_LIMIT = 4.5
"""Standard errors. False alarms: 7e-6 for each channel by the normal law; should a few
fireflies carry all of the variance, (1 / (S + 1))^5, 3e-4 with four references."""

TILE_FALSE_ALARMS = 1e-4
"""For each channel, by the bound of Laurent and Massart (2000), Lemma 1. A picture has
three and fails if one does: at most 3e-4."""

WORST_TILE_LIMIT = 7.0
"""Standard errors of one tile. Simulated, not proven: in 18,000 equal pictures, some with
Pareto noise of index 1.1, 1.8 and 3 and some with sparse fireflies, the largest was 5.3
(four references). A bound in Hoeffding's manner, which holds for any noise, gives 9.5."""

Picture = NDArray[np.floating]


@dataclass(frozen=True)
class BiasTest:
    """One number that a bias makes larger."""

    value: float
    floor: float  # what noise alone makes of it: its root mean square
    limit: float

    @property
    def passed(self) -> bool:
        """Whether it can be noise."""
        return self.value <= self.limit


@dataclass(frozen=True, eq=False)
class BiasTests:
    """Three scales: the picture, all its tiles together, each tile by itself."""

    mean: BiasTest  # worst channel, relative to Mitsuba's mean
    tiles: BiasTest  # worst channel, root mean square in standard errors
    worst_tile: BiasTest  # of all channels, in standard errors
    tile_count: int


def bias_tests(ours: Picture, references: Sequence[Picture], tile: int = TILE) -> BiasTests:
    """Test a picture (H, W, C) against two or more of the same shape with other seeds."""
    if len(references) < 2:
        raise ValueError("noise can only be told from two references or more")
    pictures = stack([ours, *references])
    count = len(pictures)
    # x_k less the mean of the others is (x_k - mean of all) n / (n - 1).
    deviations = (pictures - pictures.mean(axis=0)) * (count / (count - 1))
    variances = np.mean(deviations**2, axis=0)
    d, v = tile_sums(deviations[0], tile), tile_sums(variances, tile)
    means = tile_sums(pictures[1:].mean(axis=0), tile)
    squares = standard_errors(d, v, means) ** 2
    tiles = squares.shape[0] * squares.shape[1]
    # The squares of T standardised differences add up to about T, as a chi-square variable
    # with T degrees of freedom does.
    x = math.log(1.0 / TILE_FALSE_ALARMS)
    most = tiles + 2.0 * math.sqrt(tiles * x) + 2.0 * x
    together = float(np.max(np.sum(squares, axis=(0, 1))))
    return BiasTests(
        mean=_mean_test(d, v, means),
        tiles=BiasTest(math.sqrt(together / tiles), 1.0, math.sqrt(most / tiles)),
        worst_tile=BiasTest(math.sqrt(float(np.max(squares))), 1.0, WORST_TILE_LIMIT),
        tile_count=tiles,
    )


def _mean_test(d: Floats, v: Floats, means: Floats) -> BiasTest:
    """Test the sums over the whole picture, channel by channel; return the worst."""
    tests = []
    for channel in range(d.shape[-1]):
        scale = abs(float(np.sum(means[..., channel]))) or 1.0
        difference = abs(float(np.sum(d[..., channel]))) / scale
        error = math.sqrt(float(np.sum(v[..., channel]))) / scale
        tests.append(BiasTest(difference, error, MEAN_LIMIT * error + ROUNDING))
    return max(tests, key=lambda test: test.value / test.limit)
