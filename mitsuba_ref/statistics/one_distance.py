"""One picture's distance from several of Mitsuba's, compared with theirs, and its noise.

A few fireflies carry most of a squared distance, which wanders with them from seed to seed.
How far, relabelling tells as in `one_picture`: in a pixel, let x_k be the mean squared
difference of picture k from the others, less that among the others. Over ours and the
references x_k has mean zero, and each is as likely to be ours if ours is one more picture
of Mitsuba's. Pixels are independent, so that the sum of x over them has as its variance
the sum of mean_k x_k^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.distances import TRIMMED_FRACTION, tile_sums
from mitsuba_ref.statistics.floors import Distance, all_distances
from mitsuba_ref.statistics.samples import Floats, stack

EXCESS_LIMIT = 4.5
"""Standard errors of a squared distance beyond its floor. False alarms: 3e-6 by the normal
law; should a few equal fireflies carry all of it, six of them have to be in ours and none
in n references, (n + 1)^-6: 6e-5 with four, 1e-3 with the two of the scene's own filter."""

Picture = NDArray[np.floating]


def beside_floor(
    ours: Picture, references: Sequence[Picture], distance: Distance
) -> tuple[float, float]:
    """Return (how far one picture is from the references, how far these are apart).

    Root mean squares over the pairs.
    """
    table = all_distances([ours, *references], distance)
    pairs = table[1:, 1:][np.triu_indices(len(references), 1)]
    across, within = (np.sqrt(np.mean(found**2)) for found in (table[0, 1:], pairs))
    return float(across), float(within)


def most_by_noise(
    ours: Picture,
    references: Sequence[Picture],
    floor: float,
    *,
    trimmed: bool = False,
    tile: int = 1,
) -> float:
    """Return the largest RMSE from the references that noise explains, given their floor.

    Parameters
    ----------
    ours, references
        Pictures (H, W, C); two references or more.
    floor
        Their RMSE among themselves, as of `beside_floor`.
    trimmed
        Whether the distance leaves out the largest values (`distances.trimmed_rmse`): then
        none counts for more than the smallest of those.
    tile
        Edge [pixels] of squares within which pixels may share samples.
    """
    excesses = _excesses(stack([ours, *references]), trimmed)
    sums = np.stack([tile_sums(x[..., np.newaxis], tile) for x in excesses])
    variance = float(np.sum(np.mean(sums**2, axis=0)))
    return math.sqrt(floor**2 + EXCESS_LIMIT * math.sqrt(variance) / np.size(ours))


def _excesses(pictures: Floats, trimmed: bool) -> Floats:
    """Return x_k of each pixel, (K, H, W), squares summed over the channels."""
    count = len(pictures)
    to_others = np.zeros(pictures.shape[:3])
    for i, j in combinations(range(count), 2):
        squares = (pictures[i] - pictures[j]) ** 2
        if trimmed:
            squares = np.minimum(squares, np.quantile(squares, 1.0 - TRIMMED_FRACTION))
        of_pixel = squares.sum(axis=2)
        to_others[i] += of_pixel
        to_others[j] += of_pixel
    among_others = 0.5 * to_others.sum(axis=0) - to_others
    pairs = (count - 1) * (count - 2) / 2
    return np.asarray(to_others / (count - 1) - among_others / pairs)
