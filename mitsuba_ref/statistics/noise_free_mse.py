"""The squared difference of two expectations, without the noise of the pictures.

With independent pictures A1, A2 of one renderer and B1, B2 of the other,
E[(A1 - B1)(A2 - B2)] = (E A - E B)^2: the two factors have independent noise.
The mean over all such pairs of pairs is |mean A - mean B|^2 - s_A^2 / K - s_B^2 / L, an
estimate without bias, for any noise and any filter. It can be negative,
which says that it is below what these pictures can tell.

Sees differences of both signs all over the picture: a shifted texture, another blur. In a
plain MSE the brightest and noisiest pixels decide: of the Cornell box at 32 x 32 pixels
those at the light's edge, and a picture turned left to right passes. So the ladder takes
pictures divided by their brightness (`relative_to_brightness`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_ref.metrics.distances import tile_means
from mitsuba_ref.statistics.hypothesis_tests.relabelling import (
    SEED,
    deals,
    limit_of,
    quadratic,
    rank_p,
)
from mitsuba_ref.statistics.samples import Floats

DEALS = 9999
RESAMPLES = 2000
CONFIDENCE = 0.99
DARK = 0.1


@dataclass(frozen=True)
class NoiseFreeMse:
    """Mean over pixels and channels of (E ours - E theirs)^2, estimated."""

    value: float
    low: float  # confidence interval, by a bootstrap over tiles
    high: float
    limit: float
    p_value: float  # rank among relabelled pictures
    spread: float  # standard deviation over relabelled pictures
    mean_square: float  # of the pictures, also without their noise: for relative numbers


def noise_free_mse(
    ours: Floats, theirs: Floats, alpha: float, most_deals: int = DEALS
) -> NoiseFreeMse:
    """Estimate and test the squared difference of the expectations of pictures.

    Parameters
    ----------
    ours, theirs
        (K, H, W, C) and (L, H, W, C). The confidence interval takes tiles as independent
        (box filter); value and p-value do not.
    alpha
        False alarm rate, for `limit`.
    most_deals
        Number of relabellings.
    """
    everything = np.concatenate([ours, theirs])
    centred = (everything - everything.mean(axis=0)).reshape(len(everything), -1)
    products = centred @ centred.T / centred.shape[1]
    values = _for_deals(products, deals(len(ours), len(theirs), most_deals))
    low, high = _bootstrap(squared_difference(ours, theirs))
    return NoiseFreeMse(
        value=float(values[0]),
        low=low,
        high=high,
        limit=limit_of(values, alpha),
        p_value=rank_p(values),
        spread=float(np.std(values)),
        mean_square=_mean_square(theirs),
    )


def relative_to_brightness(ours: Floats, theirs: Floats) -> tuple[Floats, Floats]:
    """Return the pictures, each value divided by the brightness of its pixel and channel.

    Brightness is the mean of all pictures, labels unseen, and at least about a tenth of
    the whole picture's mean: a relative error of black is no error.
    """
    scale = brightness(np.concatenate([ours, theirs]).mean(axis=0))
    return ours / scale, theirs / scale


def brightness(mean: Floats) -> Floats:
    """Return what the pixels of a picture are divided by, about its values but never 0."""
    return np.asarray(np.sqrt(mean**2 + (DARK * np.mean(np.abs(mean))) ** 2) + 1e-300)


def squared_difference(ours: Floats, theirs: Floats) -> Floats:
    """Return the estimate for each pixel and channel, (H, W, C); half are negative."""
    noise = ours.var(axis=0, ddof=1) / len(ours) + theirs.var(axis=0, ddof=1) / len(theirs)
    return np.asarray((ours.mean(axis=0) - theirs.mean(axis=0)) ** 2 - noise)


def _mean_square(pictures: Floats) -> float:
    mean, noise = pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / len(pictures)
    return max(0.0, float(np.mean(mean**2 - noise)))


def _for_deals(products: Floats, dealt: np.ndarray) -> Floats:
    """Return the estimate for each deal from the pictures' scalar products alone.

    With a of n pictures in a group, the sum of their squares Q and the square of their
    sum S, the group's variance of the mean is (Q - S / a) / (a (a - 1)).
    """
    first = dealt.astype(np.float64)
    second = 1.0 - first
    a, b = first.sum(axis=1), second.sum(axis=1)
    weights = first / a[:, None] - second / b[:, None]
    squares = np.diag(products)
    result = quadratic(weights, products, weights)
    for group, size in ((first, a), (second, b)):
        of_sum = quadratic(group, products, group)
        result = result - (group @ squares - of_sum / size) / (size * (size - 1.0))
    return np.asarray(result)


def _bootstrap(estimates: Floats) -> tuple[float, float]:
    """Draw tiles with replacement; return the percentile interval of the mean.

    Tiles at the border count as much as whole ones: at most a few in a hundred are cut.
    """
    tiles = tile_means(estimates).mean(axis=-1).ravel()
    rng = np.random.default_rng(SEED)
    means = tiles[rng.integers(0, tiles.size, (RESAMPLES, tiles.size))].mean(axis=1)
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = np.quantile(means, [tail, 1.0 - tail])
    return float(low), float(high)
