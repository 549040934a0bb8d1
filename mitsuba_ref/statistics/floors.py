"""Distances of two renderers' pictures, compared with the distances within each: floors.

A distance between two noisy pictures says little by itself. It is compared with its floor,
the same distance between two pictures of one renderer. If both draw from one distribution,
the mean distance across is the mean of those within [Szekely2013]. If they only have
different noise, it lies between the two. So what counts is its excess over the *larger*
floor, judged by its rank among relabelled pictures: exact for equal noise and any distance,
on the safe side for different noise (in the scene "emitters" ours is half of Mitsuba's).

With a single picture of ours there are too few relabellings for a rank: `one_distance`.

Sees a bias that is large compared with the noise of one picture. It does not see more noise
on one side; the comparison of RMSE with Mitsuba's floor does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import distances
from mitsuba_ref.statistics.hypothesis_tests.relabelling import (
    deals,
    limit_of,
    quadratic,
    rank_p,
)
from mitsuba_ref.statistics.samples import Floats

DEALS = 9999

Distance = Callable[[NDArray[np.floating], NDArray[np.floating]], float]


def _unlike(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    similarity = distances.ssim(a, b)
    return 0.0 if similarity is None else 1.0 - similarity


DISTANCES: dict[str, Distance] = {
    "rmse": distances.rmse,
    "one minus ssim": _unlike,
    "flip": distances.flip,
}


@dataclass(frozen=True)
class Floor:
    """One distance between the renderers and the distances within each."""

    name: str
    across: float  # mean over all pairs of one of ours and one of theirs
    ours: float  # mean over pairs of ours
    theirs: float
    excess: float  # across less the larger of the two floors
    limit: float
    p_value: float
    spread: float  # standard deviation of the excess over relabelled pictures


def floor_tests(ours: Floats, theirs: Floats, alpha: float) -> list[Floor]:
    """Test each of `DISTANCES`; `alpha` is the false alarm rate of all together.

    Parameters
    ----------
    ours, theirs
        Pictures (K, H, W, 3) in linear sRGB.
    alpha
        False alarm rate; each test has its share (Bonferroni).
    """
    pictures = [*ours, *theirs]
    dealt = deals(len(ours), len(theirs), DEALS)
    return [
        floor_test(name, all_distances(pictures, distance), dealt, alpha / len(DISTANCES))
        for name, distance in DISTANCES.items()
    ]


def all_distances(pictures: Sequence[NDArray[np.floating]], distance: Distance) -> Floats:
    """Return the distances of all pairs, (n, n), symmetric, with zeros in the diagonal."""
    table = np.zeros((len(pictures), len(pictures)))
    for i, first in enumerate(pictures):
        for j in range(i):
            table[i, j] = table[j, i] = distance(first, pictures[j])
    return table


def floor_test(name: str, table: Floats, dealt: NDArray[np.bool_], alpha: float) -> Floor:
    """Judge a table of distances; the first row of `dealt` has the true labels."""
    first = dealt.astype(np.float64)
    second = 1.0 - first

    def mean(left: Floats, right: Floats, same: bool) -> Floats:
        total = quadratic(left, table, right)
        n, m = left.sum(axis=1), right.sum(axis=1)
        return np.asarray(total / (n * (n - 1.0) if same else n * m))

    across = mean(first, second, False)
    within, within_other = mean(first, first, True), mean(second, second, True)
    excess = across - np.maximum(within, within_other)
    return Floor(
        name=name,
        across=float(across[0]),
        ours=float(within[0]),
        theirs=float(within_other[0]),
        excess=float(excess[0]),
        limit=limit_of(excess, alpha),
        p_value=rank_p(excess),
        spread=float(np.std(excess)),
    )
