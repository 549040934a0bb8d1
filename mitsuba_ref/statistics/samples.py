"""Pictures of one renderer with different seeds, as one array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDING = 1e-4
"""Relative difference that no test calls a bias: what single precision may do to a sum of
thousands of samples, with a margin. A pixel with less noise counts as free of noise."""


def standard_errors(
    difference: Floats, variance: Floats, scale: Floats, forgiven: float = ROUNDING
) -> Floats:
    """Return a difference in units of its noise, less the part that may be rounding.

    Signed; 0 where rounding explains the difference, infinite where it does not and the
    noise is 0.

    Parameters
    ----------
    difference, variance, scale
        The variance is that of the difference; `forgiven` refers to the scale.
    forgiven
        Relative difference that is ignored.
    """
    excess = np.maximum(np.abs(difference) - forgiven * np.abs(scale), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.sign(difference) * excess / np.sqrt(variance)
    return np.where(excess > 0.0, z, 0.0)


def stack(pictures: Sequence[NDArray[np.floating]]) -> Floats:
    """Return pictures as (K, H, W, C) in double precision.

    Raises
    ------
    ValueError
        For fewer than two pictures, another number of axes or different sizes.
    """
    shapes = {np.shape(picture) for picture in pictures}
    if len(pictures) < 2:
        raise ValueError(f"noise can only be told from two pictures, not {len(pictures)}")
    if len(shapes) != 1 or len(next(iter(shapes))) != 3:
        raise ValueError(f"expected pictures of one shape (H, W, C), found {shapes}")
    return np.stack([np.asarray(picture, dtype=np.float64) for picture in pictures])
