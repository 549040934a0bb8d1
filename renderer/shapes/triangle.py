"""Ray against triangle, by both methods of the lecture.

The renderer uses `hit_triangle`, the plane method with the normal stored beside the
triangle: 29 multiplications and additions against 38 of Moeller-Trumbore.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.lanes.functions import any_of
from renderer.shapes.patch import (
    MARGIN,
    ONE,
    Intersection,
    divided,
    grazing,
    lesser,
    meet_plane,
    meet_plane_in_double,
)
from renderer.vectors import cross, dot


class Triangles(NamedTuple):
    """Triangles in the order of an accelerator; all groups are padded by 16 columns."""

    corner: NDArray[np.float32]  # (3, n) p1 of the lecture
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) edge1 x edge2, not normalised
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@kernel
def _depth_inside(p):
    """Return how deep in the triangle the point is, times scale: the least of u, v, w.

    w last: it is NaN if u or v is, and then so is the result.
    """
    return lesser(lesser(p.u, p.v), p.scale - (p.u + p.v))


@kernel
def hit_triangle(triangle, origin, direction, t_max):
    """Plane, then (u, v): hits have 0 < t <= t_max, u >= 0, v >= 0 and u + v <= 1."""
    p = meet_plane(triangle, origin, direction)
    depth = _depth_inside(p)
    doubtful = grazing(triangle, p, direction) & (depth >= MARGIN * p.scale)
    if any_of(doubtful):
        p = meet_plane_in_double(triangle, origin, direction, doubtful, p)
        depth = _depth_inside(p)
    return divided(p, depth >= 0.0, t_max)


@kernel
def hit_triangle_moeller_trumbore(triangle, origin, direction, t_max):
    """Intersect without a stored normal [Moeller1997]; the same result within rounding."""
    p = cross(direction, triangle.edge2)
    determinant = dot(triangle.edge1, p)
    inverse = ONE / determinant
    to_origin = origin - triangle.corner
    u = dot(to_origin, p) * inverse
    q = cross(to_origin, triangle.edge1)
    v = dot(direction, q) * inverse
    t = dot(triangle.edge2, q) * inverse
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    return Intersection(inside & (t > 0.0) & (t <= t_max), t, u, v)
