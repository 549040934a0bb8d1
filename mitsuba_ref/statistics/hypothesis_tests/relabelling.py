"""Exact p-values by relabelling: pictures dealt out otherwise to the two renderers.

If both renderers draw from one distribution of pictures, then "ours" and "theirs" are mere
labels, and the statistic for the true labels is one more draw among those for any other
deal [Fisher1935]. So its rank gives a p-value that is exact for any noise, for heavy
tails, black pixels and pixels that depend on each other, and for any statistic. The price:
with K pictures a side no p-value is below 2 / C(2K, K), 1.6e-4 for K = 8; and renderers
with the same expectation but other noise (another sampler) are not exchangeable, so that
such a test answers "equally distributed?", not only "equal on average?".
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.statistics.samples import Floats

SEED = 20200101
"""Of the random deals, fixed so that a result is the same each time."""


def deals(ours: int, theirs: int, most: int) -> NDArray[np.bool_]:
    """Return ways to deal out the labels, (R, ours + theirs), true for "ours".

    The first row is the true one. All different ways where there are at most `most`, else
    `most` random ones; with as many on both sides a deal and its opposite count as one, as
    statistics here are two-sided.
    """
    total = ours + theirs
    ways = math.comb(total, ours)
    halves = ours == theirs
    if (ways // 2 if halves else ways) > most:
        rng = np.random.default_rng(SEED)
        order = np.argsort(rng.random((most, total)), axis=1)
        order[0] = np.arange(total)
        return np.asarray(order < ours)
    chosen = itertools.combinations(range(total), ours)
    rows = [row for row in chosen if not halves or row[0] == 0]
    dealt = np.zeros((len(rows), total), dtype=bool)
    dealt[np.arange(len(rows))[:, None], np.array(rows)] = True
    return dealt


def quadratic(left: Floats, table: Floats, right: Floats) -> Floats:
    """Return the sum over i, j of left_i table_ij right_j for each row, (R,)."""
    return np.asarray(np.sum((left @ table) * right, axis=1))


def rank_p(statistics: Floats) -> float:
    """Return the share of deals whose statistic is as large as the first, the true one.

    Values that differ by rounding alone count as equal, which can only raise p.
    """
    true = statistics[0]
    slack = 1e-9 * float(np.max(np.abs(statistics)))
    return float(np.mean(statistics >= true - slack))


def limit_of(statistics: Floats, alpha: float) -> float:
    """Return the smallest statistic with a `rank_p` of at most `alpha`.

    Infinite where there are too few deals for such a p-value.
    """
    allowed = int(alpha * len(statistics))
    return float(np.sort(statistics)[-allowed]) if allowed else math.inf
