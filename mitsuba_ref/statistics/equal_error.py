"""What a sampler or a renderer is worth at equal samples: the inverse of error times time.

relMSE is the mean over pixels and channels of (a - r)^2 / (r^2 + 0.01 m^2), where a is a
picture, r the reference and m the reference's mean, without the largest 0.1 %: on the edge
of a light a few pixels may hold three quarters of the sum, which then tells nothing.

Of independent samples relMSE is inverse to their number, and seconds are proportional to
it. The quotient of 1 / (relMSE seconds) of two renderers is then by how much faster one of
them reaches the same error, for any number of samples. With stratified samples relMSE falls
faster, and how much depends on the scene. The quotient then holds for one number of samples
only, which must be stated with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.accuracy import relative_error


def relative_mse_of(picture: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """Return the relMSE of a picture (H, W, 3): the square of the error that renders claim.

    The reference's own noise is in it. Of a reference of n times the samples of a picture
    of the same sampler, that is 1 / n of this picture's relMSE, or less.

    Raises
    ------
    ValueError
        If either holds what is no finite number, whose error cannot be told.
    """
    for name, values in (("picture", picture), ("reference", reference)):
        wrong = np.argwhere(~np.isfinite(values))
        if len(wrong):
            y, x = wrong[0, :2]
            raise ValueError(
                f"{len(wrong)} of {values.size} values of the {name} are not finite, the "
                f"first at x = {x}, y = {y}"
            )
    return relative_error(picture - reference, reference) ** 2


def worth(errors: Sequence[float], seconds: Sequence[float]) -> float:
    """Return 1 / (mean relMSE x median seconds) of the pictures of one contender."""
    product = float(np.mean(errors) * np.median(seconds))
    return 1.0 / product if product > 0.0 else math.inf


def log_ratio_error(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the standard error of log(worth of the first / worth of the second).

    Parameters
    ----------
    first, second
        relMSE x seconds of each seed, at least two. What both met in the turn of a seed (a
        busy machine) cancels in that seed's quotient.
    """
    if min(*first, *second) <= 0.0:
        return math.inf
    logs = np.log(second) - np.log(first)
    return float(logs.std(ddof=1) / len(logs) ** 0.5)


def geometric_mean(ratios: Sequence[float]) -> float:
    """Return the geometric mean of positive numbers."""
    return float(np.exp(np.mean(np.log(ratios))))
