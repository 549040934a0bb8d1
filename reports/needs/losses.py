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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.distances import flip, tile_means
from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t
from renderer.rendering.accuracy import LEFT_OUT, relative_squares
from reports.needs.record import Loss

ALPHA = 0.05  # of the intervals, two-sided

Pictures = Sequence[NDArray[np.float32]]
Floats = NDArray[np.float64]


def loss_between(
    full: Pictures,
    less: Pictures,
    reference: NDArray[np.float32],
    words: Sequence[str],
    sentence: str,
    time: float,
) -> Loss:
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
    independent = float((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)).sum())
    shared = float(d.var(axis=0, ddof=1).sum())
    limit = np.asarray(reference, np.float64)
    error, high = _relative_loss(d, limit)
    before, after = _relative_variance(a, limit), _relative_variance(b, limit)
    return Loss(
        words=list(words),
        sentence=sentence,
        mean=float(mean) / level,
        mean_half_width=float(mean_width) / level,
        tile=float(tile[worst]) / level,
        tile_half_width=float(tile_width[worst]) / level,
        tiles_off=int(np.sum(np.abs(tile) > tile_width)),
        tiles=tile.size,
        error=error,
        error_high=high,
        flip=flip(_float32(b.mean(axis=0)), _float32(a.mean(axis=0))) if d.any() else 0.0,
        time=time,
        shared_variance=shared / independent if independent else None,
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


def _relative_loss(d: Floats, reference: Floats) -> tuple[float, float]:
    """Return the root of the noise-free mean relative square, and its upper end.

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
    t = critical_t(ALPHA, 1, count - 1)
    return _root(whole), _root(max(whole, 0.0) + t * float(error))


def _noise_free_square(d: Floats) -> float:
    """Return the mean of d_i d_j over all pairs of rows and all columns."""
    count = len(d)
    pairs = d.sum(axis=0) ** 2 - (d**2).sum(axis=0)
    return float(pairs.mean()) / (count * (count - 1))


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)))


def _float32(picture: Floats) -> NDArray[np.float32]:
    return picture.astype(np.float32)
