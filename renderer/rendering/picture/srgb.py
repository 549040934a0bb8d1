"""The transfer curve of sRGB: from light to the numbers that a screen expects."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """Encode linear values by the curve of IEC 61966-2-1.

    Parameters
    ----------
    linear
        Any shape; clipped to [0, 1] first, so that infinity is 1. NaN stays NaN.

    Returns
    -------
    Values in [0, 1], float64, of the same shape.
    """
    clipped = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    curve = 1.055 * np.power(clipped, 1.0 / 2.4) - 0.055
    return np.where(clipped <= 0.0031308, 12.92 * clipped, curve)
