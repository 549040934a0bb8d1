"""The surface area of an intersection of slabs: each face cut out of its plane.

A large square in the plane is clipped by all other half-spaces [Sutherland1974]. That
needs no vertex enumeration and stands degenerate volumes: flat, a line, a point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Polygon = NDArray[np.float64]  # (m, 3)


def polytope_area(
    normals: NDArray[np.float64], lower: ArrayLike, upper: ArrayLike
) -> float:
    """Return the surface area of { x : lower <= normals x <= upper }.

    Parameters
    ----------
    normals
        (s, 3), of any length; the first three are across each other: they bound it.
    lower, upper
        (s,), lower <= upper.
    """
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    # around the middle of the box, so that far volumes do not cost digits
    middle = np.linalg.solve(normals[:3], (low[:3] + high[:3]) / 2.0)
    shift = normals @ middle
    size = 2.0 * float(np.linalg.norm(high[:3] - low[:3]))
    planes = np.concatenate((normals, -normals))
    offsets = np.concatenate((high - shift, shift - low))
    return sum(_face_area(planes, offsets, k, size) for k in range(len(planes)))


def _face_area(
    planes: NDArray[np.float64], offsets: NDArray[np.float64], face: int, size: float
) -> float:
    """Return the area of the part of plane `face` that is behind all others."""
    slabs = len(planes) // 2
    polygon = _square(planes[face], offsets[face], size)
    for other in range(len(planes)):
        if other % slabs == face % slabs:  # itself, and the other side of its slab
            continue
        polygon = _clipped(polygon, planes[other], offsets[other])
        if len(polygon) < 3:
            return 0.0
    fans = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])
    return float(np.linalg.norm(fans.sum(axis=0))) / 2.0


def _square(normal: NDArray[np.float64], offset: float, size: float) -> Polygon:
    """Return a square in the plane normal . x = offset that holds all of the volume."""
    n = normal / np.linalg.norm(normal)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    center = normal * (offset / (normal @ normal))
    return center + size * np.array([u + v, v - u, -u - v, u - v])


def _clipped(polygon: Polygon, normal: NDArray[np.float64], offset: float) -> Polygon:
    """Return the part of a convex polygon with normal . x <= offset."""
    depth = offset - polygon @ normal
    kept = []
    for k in range(len(polygon)):
        a, b = depth[k - 1], depth[k]
        if (a >= 0.0) != (b >= 0.0):
            kept.append(polygon[k - 1] + (polygon[k] - polygon[k - 1]) * (a / (a - b)))
        if b >= 0.0:
            kept.append(polygon[k])
    return np.array(kept).reshape(-1, 3)
