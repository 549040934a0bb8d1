"""Is a difference more than noise? Three tests that know the noise of this very picture.

Under the hypothesis "our picture is one more picture of Mitsuba's, with another seed", the
values of a pixel in all pictures are exchangeable, and pixels are independent (box
filter). So for each pixel, with k over ours and the S references, d_k = x_k - mean of the
others has mean zero, and v = mean_k d_k^2 is the variance of d_ours given the set of
values: no assumption about the shape of the noise, and a firefly raises its own variance.
With D and V the sums of d and v over n pixels, D / sqrt(V) has variance 1.

An error of one part in ten thousand of the value is rounding, not noise, and is forgiven.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.distances import TILE, tile_sums

ROUNDING = 1e-4
"""Relative difference of sums that the tests forgive."""

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
class MeanTest:
    """The worst channel's difference of picture means, relative to the reference's mean."""

    difference: float  # without sign
    standard_error: float
    limit: float  # MEAN_LIMIT standard errors and what is forgiven as rounding

    @property
    def passed(self) -> bool:
        """Whether the difference can be noise."""
        return self.difference <= self.limit


@dataclass(frozen=True)
class TileTest:
    """Tile differences in standard errors: the root mean square, and the largest."""

    statistic: float  # of the worst channel, about 1 for noise
    limit: float
    tiles: int
    worst: float  # over all tiles and channels, without sign

    @property
    def passed(self) -> bool:
        """Whether the tiles together differ by noise alone."""
        return self.statistic <= self.limit

    @property
    def worst_passed(self) -> bool:
        """Whether each single tile does: among many right ones a wrong one drowns."""
        return self.worst <= WORST_TILE_LIMIT


def mean_test(ours: Picture, references: Sequence[Picture]) -> MeanTest:
    """Compare the means of whole pictures, channel by channel; return the worst channel.

    Parameters
    ----------
    ours
        (H, W, C).
    references
        At least two pictures of the same shape with different seeds.
    """
    differences, variances, means = _pixel_terms(ours, references)
    tests = []
    for channel in range(differences.shape[-1]):
        scale = abs(float(np.sum(means[..., channel]))) or 1.0
        difference = abs(float(np.sum(differences[..., channel]))) / scale
        error = math.sqrt(float(np.sum(variances[..., channel]))) / scale
        tests.append(MeanTest(difference, error, MEAN_LIMIT * error + ROUNDING))
    return max(tests, key=lambda test: test.difference / test.limit)


def tile_test(ours: Picture, references: Sequence[Picture], tile: int = TILE) -> TileTest:
    """Compare means of tiles: finds biases that cancel over the whole picture.

    The squares of T standardised tile differences add up to about T, as a chi-square
    variable with T degrees of freedom does.
    """
    differences, variances, means = (
        tile_sums(term, tile) for term in _pixel_terms(ours, references)
    )
    forgiven = np.maximum(np.abs(differences) - ROUNDING * np.abs(means), 0.0)
    squares = np.divide(
        forgiven**2, variances, out=np.zeros_like(variances), where=variances > 0.0
    )
    tiles = squares.shape[0] * squares.shape[1]
    worst = float(np.max(np.sum(squares, axis=(0, 1))))
    x = math.log(1.0 / TILE_FALSE_ALARMS)
    limit = tiles + 2.0 * math.sqrt(tiles * x) + 2.0 * x
    return TileTest(
        statistic=math.sqrt(worst / tiles),
        limit=math.sqrt(limit / tiles),
        tiles=tiles,
        worst=math.sqrt(float(np.max(squares))),
    )


def _pixel_terms(
    ours: Picture, references: Sequence[Picture]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return d of ours, v, and the mean of the references, each (H, W, C)."""
    if len(references) < 2:
        raise ValueError("noise can only be told from two references or more")
    pictures = np.stack([ours, *references]).astype(np.float64)
    count = len(pictures)
    # x_k less the mean of the others is (x_k - mean of all) n / (n - 1).
    deviations = (pictures - pictures.mean(axis=0)) * (count / (count - 1))
    return deviations[0], np.mean(deviations**2, axis=0), pictures[1:].mean(axis=0)
