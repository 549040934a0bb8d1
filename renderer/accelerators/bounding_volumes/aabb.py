"""Axis-aligned bounding box: three slabs along x, y and z. Six numbers, often too big."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.accelerators.bounding_volumes.grown_points import (
    grown_points,
    rounded_down,
    rounded_up,
)
from renderer.accelerators.bounding_volumes.slab import ONE, clip_to_slab, ray_interval
from renderer.kernels.jit import kernel


class Aabb(NamedTuple):
    """Two opposite corners."""

    lower: NDArray[np.float32]  # (3,)
    upper: NDArray[np.float32]  # (3,)


def fit_aabb(points: ArrayLike, radius: ArrayLike = 0.0) -> Aabb:
    """Return the smallest box, up to rounding, around points (3, n) grown by radii (n,).

    Raises
    ------
    ValueError
        If there is no point, or something is not finite, or a radius is negative.
    """
    grown = grown_points(points, radius)
    lower = (grown.center - grown.radius).min(axis=1) - grown.pad
    upper = (grown.center + grown.radius).max(axis=1) + grown.pad
    return Aabb(rounded_down(lower), rounded_up(upper))


@kernel
def hits_aabb(box, origin, direction, t_max):
    """Return whether rays meet the box at 0 <= t <= t_max."""
    enter, leave, margin = ray_interval(origin, direction, t_max)
    x, y, z = ONE / direction.x, ONE / direction.y, ONE / direction.z
    x0 = (box.lower[0] - margin - origin.x) * x
    x1 = (box.upper[0] + margin - origin.x) * x
    y0 = (box.lower[1] - margin - origin.y) * y
    y1 = (box.upper[1] + margin - origin.y) * y
    z0 = (box.lower[2] - margin - origin.z) * z
    z1 = (box.upper[2] + margin - origin.z) * z
    enter, leave = clip_to_slab(x0, x1, enter, leave)
    enter, leave = clip_to_slab(y0, y1, enter, leave)
    enter, leave = clip_to_slab(z0, z1, enter, leave)
    return enter <= leave


def area_aabb(box: Aabb) -> float:
    """Return the surface area: 4 times the mean projected area (Cauchy, see k_dop.py)."""
    a, b, c = np.subtract(box.upper, box.lower, dtype=np.float64)
    return float(2.0 * (a * b + b * c + c * a))


def contains_aabb(
    box: Aabb, points: ArrayLike, radius: ArrayLike = 0.0
) -> NDArray[np.bool_]:
    """Return (n,): whether the box holds each of the points (3, n) grown by its radius."""
    p, r = np.asarray(points, np.float64), np.asarray(radius, np.float64)
    inside = (p - r >= box.lower[:, None]) & (p + r <= box.upper[:, None])
    return np.asarray(inside.all(axis=0))
