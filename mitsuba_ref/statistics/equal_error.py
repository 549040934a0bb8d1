"""What a sampler or a renderer is worth: the inverse of error times time.

The error of a mean of independent samples falls as one over their number, and so does its
square times the seconds stay the same: 1 / (relMSE seconds) tells two renderers apart at
any number of samples, and how many times faster one of them has the same error.

relMSE is the mean over pixels and channels of (a - r)^2 / (r^2 + 0.01 m^2), where a is a
picture, r the reference and m the reference's mean, without the largest 0.1 %: on the edge
of a light a few pixels may hold three quarters of the sum, which then tells nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.accuracy import relative_error


def relative_mse_of(picture: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """Return the relMSE of a picture (H, W, 3): the square of the error that renders claim.

    The reference's own noise is in it: of a reference of n times the samples, drawn with
    the best of the samplers, about 1 / n of that sampler's relMSE.
    """
    return relative_error(picture - reference, reference) ** 2


def worth(errors: Sequence[float], seconds: Sequence[float]) -> float:
    """Return 1 / (mean relMSE x median seconds) of the pictures of one contender."""
    product = float(np.mean(errors) * np.median(seconds))
    return 1.0 / product if product > 0.0 else math.inf


def geometric_mean(ratios: Sequence[float]) -> float:
    """Return the geometric mean of positive numbers."""
    return float(np.exp(np.mean(np.log(ratios))))
