"""Bounding sphere: the fastest test (one root and no division), mostly too big."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.accelerators.bounding_volumes.grown_points import grown_points, rounded_up
from renderer.accelerators.bounding_volumes.slab import DIAGONAL, ZERO, ray_interval
from renderer.accelerators.bounding_volumes.smallest_ball import smallest_ball
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, sqrt
from renderer.kernels.lanes.vectors import column, dot


class BoundingSphere(NamedTuple):
    """All within a distance of a point."""

    center: NDArray[np.float32]  # (3, 1)
    radius: NDArray[np.float32]  # (1,)


def fit_sphere(points: ArrayLike, radius: ArrayLike = 0.0) -> BoundingSphere:
    """Return the smallest sphere around points (3, n) grown by radii (n,).

    It is the smallest (smallest_ball.py) up to rounding: the radius grows by what rounding
    the centre to single precision costs, and by the pad, about 10^-5 of the coordinates.

    Raises
    ------
    ValueError
        If there is no point, or something is not finite, or a radius is negative.
    """
    grown = grown_points(points, radius)
    center = smallest_ball(grown.center, grown.radius).astype(np.float32)
    offset = grown.center - center[:, None].astype(np.float64)
    reach = (np.linalg.norm(offset, axis=0) + grown.radius).max()
    reach = reach * (1.0 + 1e-15) + float(DIAGONAL) * grown.pad
    return BoundingSphere(center[:, None], rounded_up([reach]))


@kernel
def hits_sphere(sphere, origin, direction, t_max):
    """Return whether rays with unit directions meet the ball at 0 <= t <= t_max.

    The distance of the line from the centre is taken from the difference vector itself,
    not from b^2 - a c, which cancels for a far ray [Haines2019].
    """
    enter, leave, margin = ray_interval(origin, direction, t_max)
    radius = sphere.radius[0] + margin * DIAGONAL
    to_center = column(sphere.center, 0) - origin
    along = dot(to_center, direction)
    across = to_center - direction * along
    gap = radius * radius - dot(across, across)
    half_chord = sqrt(select(gap > ZERO, gap, gap * ZERO))
    return (gap >= ZERO) & (along + half_chord >= enter) & (along - half_chord <= leave)


def area_sphere(sphere: BoundingSphere) -> float:
    """Return the surface area, 4 pi r^2: 4 times its projected area, pi r^2."""
    return float(4.0 * np.pi * np.float64(sphere.radius[0]) ** 2)


def contains_sphere(
    sphere: BoundingSphere, points: ArrayLike, radius: ArrayLike = 0.0
) -> NDArray[np.bool_]:
    """Return (n,): whether the ball holds each of the points (3, n) grown by its radius."""
    offset = np.asarray(points, np.float64) - sphere.center.astype(np.float64)
    reach = np.linalg.norm(offset, axis=0) + np.asarray(radius, np.float64)
    return np.asarray(reach <= sphere.radius[0])
