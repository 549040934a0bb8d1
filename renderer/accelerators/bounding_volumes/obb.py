"""Oriented bounding box: three slabs that fit the object's own directions.

Often much smaller than the axis-aligned box; a test costs three inner products more, and
the fit a search for the directions (box_axes.py).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.accelerators.bounding_volumes.box_axes import box_axes
from renderer.accelerators.bounding_volumes.grown_points import (
    grown_points,
    rounded_up,
    support,
)
from renderer.accelerators.bounding_volumes.slab import (
    DIAGONAL,
    ONE,
    clip_to_slab,
    ray_interval,
)
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot


class Obb(NamedTuple):
    """All x with |axis . (x - center)| <= half for each of three axes."""

    center: NDArray[np.float32]  # (3, 1)
    axes: NDArray[np.float32]  # (3, 3) columns: orthonormal up to rounding
    half: NDArray[np.float32]  # (3,) half the edges


def fit_obb(points: ArrayLike, radius: ArrayLike = 0.0) -> Obb:
    """Return a small box around points (3, n) grown by radii (n,).

    Never larger than the axis-aligned one, but for rounding; not always the smallest there
    is. The axes are rounded first and the half edges measured with the rounded ones, so
    that rounding lets no point out.

    Raises
    ------
    ValueError
        If there is no point, or something is not finite, or a radius is negative.
    """
    grown = grown_points(points, radius)
    axes = box_axes(grown).astype(np.float32)
    exact = axes.astype(np.float64)
    low, high = support(grown, exact)
    center = np.linalg.solve(exact, (low + high) / 2.0).astype(np.float32)
    place = exact @ center.astype(np.float64)
    half = np.maximum(high - place, place - low) + float(DIAGONAL) * grown.pad
    return Obb(center[:, None], np.ascontiguousarray(axes.T), rounded_up(half))


@kernel
def hits_obb(box, origin, direction, t_max):
    """Return whether rays meet the box at 0 <= t <= t_max."""
    enter, leave, margin = ray_interval(origin, direction, t_max)
    to_center = column(box.center, 0) - origin
    for k in range(3):
        axis = column(box.axes, k)
        middle = dot(axis, to_center)
        inverse = ONE / dot(axis, direction)
        half = box.half[k] + margin * DIAGONAL
        enter, leave = clip_to_slab(
            (middle - half) * inverse, (middle + half) * inverse, enter, leave
        )
    return enter <= leave


def area_obb(box: Obb) -> float:
    """Return the surface area: 4 times the mean projected area (Cauchy, see k_dop.py)."""
    a, b, c = box.half.astype(np.float64)
    return float(8.0 * (a * b + b * c + c * a))


def contains_obb(box: Obb, points: ArrayLike, radius: ArrayLike = 0.0) -> NDArray[np.bool_]:
    """Return (n,): whether the box holds each of the points (3, n) grown by its radius."""
    offset = np.asarray(points, np.float64) - box.center.astype(np.float64)
    axes = box.axes.T.astype(np.float64)
    grown = np.linalg.norm(axes, axis=1)[:, None] * np.asarray(radius, np.float64)
    return np.asarray((np.abs(axes @ offset) + grown <= box.half[:, None]).all(axis=0))
