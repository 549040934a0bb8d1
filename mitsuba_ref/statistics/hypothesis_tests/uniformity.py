"""Are the p-values of the pixels uniform? A Kolmogorov-Smirnov test [Jung2020].

Without a bias the p-values of a valid test are uniform; a bias too small for any single
pixel, but in many of them, makes small ones too frequent. Jung et al. look at the histogram
of p-values; this test judges it. Four things need care:

- The channels of a pixel depend on each other: a pixel counts once, with their mean.
- Pixels without noise, or with a handful of different values (an outline with few samples
  on it), have no continuous p-value and are left out. Which ones is decided by both
  renderers' values together, labels unseen.
- Renderers with different noise are not judged (`UNLIKE_NOISE`): an efficient sampler is no
  defect, and relabelled pictures, of mixed noise, are no guide to unmixed ones.
- With K = 8 pictures and heavy tails Welch's p-values are *not* uniform: with Mitsuba on
  both sides 56 % of those of the scene "caustic" lie below a half (32 x 32 pixels, 16
  samples). A textbook test would alarm there every time. So the distance is measured from
  the distribution that relabelled pictures have, and its p-value is the rank among theirs:
  exact for any noise (`relabelling`). The textbook's p-value is given as well; it alone
  sees pictures that agree too well, with the same random numbers on both sides, because
  one deal in fifty keeps each such pair apart and agrees as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from mitsuba_ref.statistics.hypothesis_tests.relabelling import deals, limit_of, rank_p
from mitsuba_ref.statistics.samples import ROUNDING, Floats

Labels = NDArray[np.bool_]
Singles = NDArray[np.float32]

DEALS = 2000
BINS = 200  # of the distribution function: its steps are half a per cent
FEWEST_VALUES = 5  # different values of a pixel, of both renderers' together
FEWEST_PIXELS = 50
UNLIKE_NOISE = 0.1
"""With more difference of noise nothing is judged: what the mean over the pixels of
|log(variance of ours / variance of theirs)| exceeds the same of alternating pictures by.
0.1 is a ratio of 1.6 everywhere, or of 10 in a tenth of the pixels. With skewed noise of
ratio 11, right pictures were 0.076 from relabelled ones and alarmed. Four scenes with equal
noise, 15 pairs each: at most 0.09, as a rule below 0.04."""

CHUNK = 50_000  # products of deals and pixels at a time: what a core's cache holds


@dataclass(frozen=True, eq=False)
class Uniformity:
    """The p-values of the pixels against what they are without a bias."""

    distance: float  # Kolmogorov-Smirnov, from the mean over relabelled pictures
    limit: float  # what it may be
    p_value: float  # rank among relabelled pictures
    textbook_p: float  # for exactly uniform p-values, and wrong for heavy tails
    pixels: int  # informative ones
    cumulative: Floats  # (BINS + 1,) share of p-values up to i / BINS
    expected: Floats  # the same, mean over relabelled pictures


def uniformity_test(
    ours: Floats, theirs: Floats, alpha: float, most_deals: int = DEALS
) -> Uniformity:
    """Test the p-values of the pixels of pictures (K, H, W, C).

    Parameters
    ----------
    ours, theirs
        Pictures whose pixels share no samples.
    alpha
        False alarm rate, for `limit`.
    most_deals
        Number of relabellings; 1 / alpha at least.

    Notes
    -----
    With too few pixels, or other noise on one side, the limit is infinite and p is 1:
    nothing was judged.
    """
    count, other = len(ours), len(theirs)
    values = informative(np.concatenate([ours, theirs]).mean(axis=-1))
    pixels = values.shape[1]
    steps = np.arange(BINS + 1) / BINS
    if pixels < FEWEST_PIXELS or unlike_noise(values, count) > UNLIKE_NOISE:
        return Uniformity(0.0, np.inf, 1.0, 1.0, pixels, steps, steps)
    dealt = deals(count, other, most_deals)
    cumulative = _cumulative(values, dealt)
    expected = cumulative.mean(axis=0)
    distances = np.max(np.abs(cumulative - expected), axis=1)
    textbook = float(np.max(np.abs(cumulative[0] - steps)))
    return Uniformity(
        distance=float(distances[0]),
        limit=limit_of(distances, alpha),
        p_value=rank_p(distances),
        textbook_p=float(stats.kstwo.sf(textbook, pixels)),
        pixels=pixels,
        cumulative=cumulative[0],
        expected=expected,
    )


def informative(values: Floats) -> Floats:
    """Return the pixels of (2 K, H, W) that have noise and enough values, (2 K, pixels)."""
    flat = values.reshape(len(values), -1)
    noisy = flat.std(axis=0) > ROUNDING * np.abs(flat).mean(axis=0)
    changes = np.count_nonzero(np.diff(np.sort(flat, axis=0), axis=0), axis=0)
    return flat[:, noisy & (changes + 1 >= FEWEST_VALUES)]


def unlike_noise(values: Floats, count: int) -> float:
    """Return how much the noise differs between the first `count` values and the rest."""
    alternating = np.argsort(np.arange(len(values)) % 2, kind="stable")

    def mean_ratio(dealt: Floats) -> float:
        ours, theirs = dealt[:count].var(axis=0), dealt[count:].var(axis=0)
        both = (ours > 0.0) & (theirs > 0.0)
        if not both.any():
            return 0.0
        return float(np.mean(np.abs(np.log(ours[both] / theirs[both]))))

    return mean_ratio(values) - mean_ratio(values[alternating])


def _cumulative(values: Floats, dealt: Labels) -> Floats:
    """Return the distribution function of the p-values for each deal, (R, BINS + 1).

    Welch's p-values, by two products of matrices: the sums and the sums of squares of one
    side are those of the other side too, since values are centred and of length 1.
    """
    centred = values - values.mean(axis=0)
    # Single precision is three times as fast and moves a p-value by less than 1e-4.
    centred = (centred / np.linalg.norm(centred, axis=0)).astype(np.float32)
    labels = dealt.astype(np.float32)
    # Ascending in z^2, hence descending in p: from p = 1 down to p = 0.
    quantiles = special.chdtri(1, 1.0 - np.arange(BINS) / BINS).astype(np.float32)
    rows = max(1, CHUNK // values.shape[1])
    below = np.empty((len(labels), BINS))
    for first in range(0, len(labels), rows):
        squares = _normal_squares(labels[first : first + rows], centred)
        squares.sort(axis=1)  # half the time of looking each of them up in the quantiles
        for k, row in enumerate(squares, first):
            below[k] = len(row) - np.searchsorted(row, quantiles)[::-1]
    below /= values.shape[1]
    return np.concatenate([np.zeros((len(below), 1)), below], axis=1)


def _normal_squares(labels: NDArray[np.float32], values: NDArray[np.float32]) -> Singles:
    """Return z^2 of the normal distribution with the p-values of Welch's test, (R, pixels).

    By Wallace's formula for z of t [Wallace1959], good to 0.02 down to 3 degrees of
    freedom: the inverse distribution function would take a hundred times as long, and all
    deals go through the same formula.
    """
    count, other = np.float32(labels[0].sum()), np.float32((1.0 - labels[0]).sum())
    one = np.float32(1.0)
    total, squares = labels @ values, labels @ values**2
    tiny = np.float32(1e-9)
    part = np.maximum(squares - total**2 / count, tiny) / (count * (count - one))
    rest = np.maximum(one - squares - total**2 / other, tiny) / (other * (other - one))
    variance = part + rest
    t_squares = (total * (one / count + one / other)) ** 2 / variance
    degrees = variance**2 / (part**2 / (count - one) + rest**2 / (other - one))
    factor = one - np.float32(2.0) / (np.float32(8.0) * degrees + np.float32(3.0))
    return np.asarray(factor**2 * degrees * np.log1p(t_squares / degrees))
