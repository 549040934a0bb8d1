"""Slabs of fixed orientations [Kay1986], in newer words a k-DOP [Klosowski1998].

k directions are k/2 pairs of half-spaces. 6: the axes, a box. 10: and two diagonals of
the faces across one axis, a box with four bevelled edges. 14: the axes and the four
diagonals of a cube, a box with bevelled corners, as Kay and Kajiya took them.

How good a volume is, is the share of random rays that meet it. By Cauchy's formula a
convex body's projected area, in the mean over all directions, is a quarter of its surface
area; so of the lines that meet a convex body, those that also meet a convex body within
it are the ratio of the two surface areas, which is computed here exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.accelerators.bounding_volumes.grown_points import (
    GrownPoints,
    grown_points,
    rounded_down,
    rounded_up,
    support,
)
from renderer.accelerators.bounding_volumes.polytope import polytope_area
from renderer.accelerators.bounding_volumes.slab import ONE, clip_to_slab, ray_interval
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot

# Whole numbers, not unit vectors: products with them are exact.
_AXES = np.eye(3)
_CORNERS = np.array([[1.0, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]])
_BEVELS = (  # edges along x, y, z
    np.array([[0.0, 1, 1], [0, 1, -1]]),
    np.array([[1.0, 0, 1], [1, 0, -1]]),
    np.array([[1.0, 1, 0], [1, -1, 0]]),
)
ORIENTATIONS = {
    6: (_AXES,),
    10: tuple(np.concatenate((_AXES, bevel)) for bevel in _BEVELS),
    14: (np.concatenate((_AXES, _CORNERS)),),
}


class KDop(NamedTuple):
    """All x with lower <= normal . x <= upper for each of s slabs."""

    normal: NDArray[np.float32]  # (3, s) whole numbers
    lower: NDArray[np.float32]  # (s,)
    upper: NDArray[np.float32]  # (s,)
    spread: NDArray[np.float32]  # (s,) |n_x| + |n_y| + |n_z|: a margin's share


def fit_k_dop(points: ArrayLike, radius: ArrayLike = 0.0, directions: int = 14) -> KDop:
    """Return the slabs around points (3, n) grown by radii (n,).

    Every plane touches a point, up to rounding. With 10 directions, of the three axes that
    edges can be bevelled along the one that gives the least area is taken.

    Raises
    ------
    ValueError
        If `directions` is not 6, 10 or 14, or there is no point, or something is not
        finite, or a radius is negative.
    """
    if directions not in ORIENTATIONS:
        known = ", ".join(map(str, ORIENTATIONS))
        raise ValueError(f"slabs of {directions} directions: there are {known}")
    grown = grown_points(points, radius)
    choices = [_slabs(grown, normals) for normals in ORIENTATIONS[directions]]
    return min(choices, key=area_k_dop) if len(choices) > 1 else choices[0]


def _slabs(points: GrownPoints, normals: NDArray[np.float64]) -> KDop:
    low, high = support(points, normals)
    spread = np.abs(normals).sum(axis=1)
    return KDop(
        np.ascontiguousarray(normals.T, np.float32),
        rounded_down(low - spread * points.pad),
        rounded_up(high + spread * points.pad),
        spread.astype(np.float32),
    )


@kernel
def hits_k_dop(slabs, origin, direction, t_max):
    """Return whether rays meet the intersection of the slabs at 0 <= t <= t_max.

    In a hierarchy the two inner products and the division are done once a ray, for all
    volumes have the same normals [Kay1986]; here they are part of the test.
    """
    enter, leave, margin = ray_interval(origin, direction, t_max)
    for k in range(slabs.normal.shape[1]):
        normal = column(slabs.normal, k)
        start = dot(normal, origin)
        inverse = ONE / dot(normal, direction)
        wide = margin * slabs.spread[k]
        enter, leave = clip_to_slab(
            (slabs.lower[k] - wide - start) * inverse,
            (slabs.upper[k] + wide - start) * inverse,
            enter,
            leave,
        )
    return enter <= leave


def area_k_dop(slabs: KDop) -> float:
    """Return the surface area; a flat volume has two sides."""
    normals = slabs.normal.T.astype(np.float64)
    return polytope_area(normals, slabs.lower, slabs.upper)


def contains_k_dop(
    slabs: KDop, points: ArrayLike, radius: ArrayLike = 0.0
) -> NDArray[np.bool_]:
    """Return (n,): whether the slabs hold each of the points (3, n) grown by its radius."""
    normals = slabs.normal.T.astype(np.float64)
    along = normals @ np.asarray(points, np.float64)
    grown = np.linalg.norm(normals, axis=1)[:, None] * np.asarray(radius, np.float64)
    inside = (along - grown >= slabs.lower[:, None]) & (
        along + grown <= slabs.upper[:, None]
    )
    return np.asarray(inside.all(axis=0))
