"""The loss between two series of pictures that share their random numbers.

Picture k of both has the seed k, and the samplers are counters of pixel, sample and
dimension: up to where the simplification makes a difference, both follow the same paths,
and their noise is not in the difference d_k. Between seeds the d_k are independent, so that
the mean of d_i d_j over all pairs i != j has no noise in it on average: it estimates the
square of the true difference at each pixel,

    mean_{i != j} d_i d_j = m^2 - sum_k (d_k - m)^2 / (K (K - 1)),   m the mean of the d_k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.distances import flip, tile_means
from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t
from renderer.rendering.accuracy import LEFT_OUT, relative_squares

ALPHA = 0.05  # of the intervals, two-sided

Pictures = Sequence[NDArray[np.float32]]
Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Loss:
    """What one simplification, or several at once, take from the picture.

    All but `flip` are relative to the mean of the full picture, or to its pixels
    (`error`); 0.01 is 1 %. Intervals are at 95 %, over seeds.
    """

    mean: float  # difference of the means of the pictures
    mean_half_width: float
    tile: float  # the same for the tile with the largest
    tile_half_width: float  # for all tiles at once
    error: float  # root of the mean relative squared difference, without the noise
    error_low: float
    error_high: float
    flip: float
    noise: float | None  # variance over that of the full scene; None: that has none

    @property
    def exact(self) -> bool:
        """Whether both pictures are the same, bit for bit."""
        return self.error_high == 0.0 and self.tile == 0.0


def loss_between(full: Pictures, less: Pictures, reference: NDArray[np.float32]) -> Loss:
    """Return the loss of `less`; picture k of both has the same seed, k < K, K >= 3.

    `reference`, which differences are relative to, is the full scene with a seed of its
    own. The mean of `full` would not do: where its noise is upwards the differences are
    downwards, and a loss of 10 % under noise of 20 % came out as 8.7 %.
    """
    a, b = np.asarray(full, np.float64), np.asarray(less, np.float64)
    d = b - a
    level = float(a.mean()) or 1.0  # a black picture: absolute
    mean, mean_width = _interval(d.mean(axis=(1, 2, 3)), 1)
    tiles = np.array([tile_means(one).mean(axis=2).ravel() for one in d])
    tile, tile_width = _interval(tiles, tiles.shape[1])
    worst = int(np.argmax(np.abs(tile)))
    limit = np.asarray(reference, np.float64)
    low, error, high = _relative_loss(d, limit)
    before, after = _relative_variance(a, limit), _relative_variance(b, limit)
    means = (np.asarray(one.mean(axis=0), np.float32) for one in (b, a))
    return Loss(
        mean=float(mean) / level,
        mean_half_width=float(mean_width) / level,
        tile=float(tile[worst]) / level,
        tile_half_width=float(tile_width[worst]) / level,
        error=error,
        error_low=low,
        error_high=high,
        flip=flip(*means) if d.any() else 0.0,
        noise=after / before if before else None,
    )


def _interval(values: Floats, tests: int) -> tuple[Any, Any]:
    """Return mean and half width over the first axis, by Student's t.

    Several intervals hold together (Sidak).
    """
    count = len(values)
    t = critical_t(ALPHA, tests, count - 1)
    return values.mean(axis=0), t * values.std(axis=0, ddof=1) / np.sqrt(count)


def _relative_variance(pictures: Floats, reference: Floats) -> float:
    """Return the mean relative variance, without the largest thousandth."""
    squares = relative_squares(pictures.std(axis=0, ddof=1), reference)
    kept = squares.size - int(LEFT_OUT * squares.size)
    return float(np.partition(squares, kept - 1, axis=None)[:kept].mean())


def _relative_loss(d: Floats, reference: Floats) -> tuple[float, float, float]:
    """Return the root of the noise-free mean relative square between the interval's ends.

    The interval is by the jackknife over seeds, wide where there is noise alone: it doubles
    the standard error of a square whose mean is 0. The thousandth of the values that
    scatter most between seeds is left out, against heavy tails; those of the largest
    difference, as in `rendering.accuracy`, would take with them what is lost.
    """
    squares = relative_squares(d.std(axis=0, ddof=1), reference)
    left_out = int(np.ceil(LEFT_OUT * squares.size)) if squares.size > 1 else 0
    kept = np.argpartition(squares, -1 - left_out, axis=None)[: squares.size - left_out]
    denominators = relative_squares(np.ones_like(reference), reference).ravel()[kept]
    chosen = d.reshape(len(d), -1)[:, kept] * np.sqrt(denominators)
    whole = _noise_free_square(chosen)
    count = len(d)
    without = [_noise_free_square(np.delete(chosen, k, axis=0)) for k in range(count)]
    scatter = np.sum((np.array(without) - np.mean(without)) ** 2)
    error = np.sqrt((count - 1) / count * scatter)
    half = critical_t(ALPHA, 1, count - 1) * float(error)
    return _root(whole - half), _root(whole), _root(max(whole, 0.0) + half)


def _noise_free_square(d: Floats) -> float:
    """Return the mean of d_i d_j over all pairs of rows and all columns."""
    count = len(d)
    pairs = d.sum(axis=0) ** 2 - (d**2).sum(axis=0)
    return float(pairs.mean()) / (count * (count - 1))


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)))
