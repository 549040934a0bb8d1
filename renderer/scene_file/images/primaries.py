"""Primaries and white of a colour space, as points x, y of the CIE 1931 diagram.

In files they are eight numbers: red, green, blue, white; x before y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # of sRGB too
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)


def differ(one: Sequence[float], other: Sequence[float], at_least: float) -> bool:
    """Tell whether the points of two colour spaces are so far apart, all together.

    Points that are NaN differ.
    """
    distance = np.linalg.norm(np.subtract(one, other, dtype=np.float64))
    return not distance < at_least


def srgb_from(points: Sequence[float]) -> NDArray[np.float32]:
    """Return the matrix, (3, 3), from a colour space to linear sRGB.

    White keeps its XYZ: there is no chromatic adaptation, as in OpenEXR and Mitsuba. All
    entries are NaN or infinite if the primaries span no colour space.
    """
    with np.errstate(all="ignore"):
        try:
            matrix = np.linalg.inv(_xyz_from(BT709)) @ _xyz_from(points)
        except np.linalg.LinAlgError:
            return np.full((3, 3), np.nan, np.float32)
        return matrix.astype(np.float32)


def _xyz_from(points: Sequence[float]) -> NDArray[np.float64]:
    """Return the matrix to XYZ: its columns are the primaries, and their sum is white."""
    x, y = np.asarray(points, np.float64).reshape(4, 2).T
    columns = np.stack([x, y, 1.0 - x - y])  # of X + Y + Z = 1
    white = columns[:, 3] / y[3]
    return np.asarray(columns[:, :3] * np.linalg.solve(columns[:, :3], white))
