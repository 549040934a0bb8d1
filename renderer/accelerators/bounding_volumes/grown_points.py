"""What volumes are fitted to: points grown by radii, and rounding that only adds.

The hull of grown points covers every kind of primitive (`Extents.points`, `.radius`).
Fitting is done in double precision and stored in single, rounded away from the points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.plugins.shapes.extents import ROUNDING, Extents


class GrownPoints(NamedTuple):
    """Balls; a point is one of radius 0."""

    center: NDArray[np.float64]  # (3, n)
    radius: NDArray[np.float64]  # (n,)
    # Room for the rounding of ray tests, along each axis: the same fraction of the
    # coordinates that boxes of primitives are padded by. The ray's own coordinates are
    # looked after in the test (slab.py).
    pad: float


def grown_points(points: ArrayLike, radius: ArrayLike = 0.0) -> GrownPoints:
    """Check and convert what a volume is to be fitted to.

    Parameters
    ----------
    points
        (3, n), n >= 1, finite.
    radius
        (n,) or one number for all, >= 0 and finite.

    Raises
    ------
    ValueError
        If that is not so.
    """
    center = np.asarray(points, np.float64)
    if center.ndim != 2 or center.shape[0] != 3 or center.shape[1] == 0:
        raise ValueError(f"a volume needs points (3, n), n >= 1, not {center.shape}")
    radii = np.broadcast_to(np.asarray(radius, np.float64), center.shape[1:])
    if not (np.isfinite(center).all() and np.isfinite(radii).all()):
        raise ValueError("a volume needs finite points and radii")
    if (radii < 0.0).any():
        raise ValueError(f"radius {radii.min()} is negative")
    largest = float((np.abs(center) + radii).max())
    return GrownPoints(center, radii, float(ROUNDING) * largest)


def points_of_extents(extents: Extents) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return (points (3, 4 n), radius (4 n,)) of primitives, for any of the fits."""
    return extents.points.reshape(3, -1), np.tile(extents.radius, 4)


def support(
    points: GrownPoints, directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the smallest and largest n . x over the grown points for directions (m, 3)."""
    along = directions @ points.center
    grown = np.linalg.norm(directions, axis=1)[:, None] * points.radius
    return (along - grown).min(axis=1), (along + grown).max(axis=1)


def rounded_up(values: ArrayLike) -> Any:
    """Return the smallest float32 that are not below the values."""
    exact = np.asarray(values, np.float64)
    near = exact.astype(np.float32)
    return np.where(near < exact, np.nextafter(near, np.float32(np.inf)), near)


def rounded_down(values: ArrayLike) -> Any:
    """Return the largest float32 that are not above the values."""
    return -rounded_up(-np.asarray(values, np.float64))
