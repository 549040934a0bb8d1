"""Mitsuba's single-precision arithmetic on triangles, rounding for rounding.

Its x86 builds use fused multiply-adds where ours never do. Most results then differ by a
rounding, which a replay forgives; two do not. The cumulated areas of a mesh light decide
which triangle a number chooses and how far it is into it, and the sign of a zero decides
the frame on a wall. The areas below agreed with Mitsuba 3.9.1 bit by bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.flat.triangle import TriangleSurfaces

Columns = NDArray[np.float32]  # (3, n)


def product_difference(a: Any, b: Any, c: Any) -> Any:
    """Return a b - c of float32; but for ties it is rounded once (through float64)."""
    return (np.multiply(a, b, dtype=np.float64) - c).astype(np.float32)


def cross(a: Columns, b: Columns) -> Columns:
    """Return a x b, of each component the second product rounded first."""
    return np.array(
        [
            product_difference(a[1], b[2], a[2] * b[1]),
            product_difference(a[2], b[0], a[0] * b[2]),
            product_difference(a[0], b[1], a[1] * b[0]),
        ]
    )


def squared_length(a: Columns) -> Any:
    """Return |a|^2, summed as four lanes are: first x and z, then y."""
    return (a[0] * a[0] + a[2] * a[2]) + a[1] * a[1]


def triangle_areas(edge1: Columns, edge2: Columns) -> Any:
    """Return the areas (n,) of triangles, float32."""
    return np.float32(0.5) * np.sqrt(squared_length(cross(edge1, edge2)))


def face_normals(edge1: Columns, edge2: Columns) -> Columns:
    """Return the unit normals (3, n) of triangles, before `flip_normals`."""
    normal = cross(edge1, edge2)
    with np.errstate(all="ignore"):
        return normal * (np.float32(1.0) / np.sqrt(squared_length(normal)))


def first_tangents(normal: Columns) -> Columns:
    """Return the first of two vectors that complete unit normals to a frame [Duff2017]."""
    x, y, z = normal
    sign = np.copysign(np.float32(1.0), z)
    a = -np.float32(1.0) / (sign + z)
    return np.array([sign * (x * x * a) + np.float32(1.0), sign * (x * y * a), -sign * x])


def triangle_tangents(triangles: TriangleSurfaces) -> Columns:
    """Return dp/du (3, n) of triangles in object space, not unit; flips leave it alone."""
    return uv_tangents(triangles.edge1, triangles.edge2, triangles.uvs)


def uv_tangents(edge1: Columns, edge2: Columns, uvs: NDArray[np.float32]) -> Columns:
    """Return dp/du (3, n) from edges and the texture coordinates (6, n) of the vertices.

    Meshes without texture coordinates have those of their barycentric ones, so edge1. Where
    u and v span no area it is the first tangent of the geometric normal.
    """
    du1, dv1 = uvs[2] - uvs[0], uvs[3] - uvs[1]
    du2, dv2 = uvs[4] - uvs[0], uvs[5] - uvs[1]
    determinant = product_difference(du1, dv2, dv1 * du2)
    with np.errstate(all="ignore"):
        along_u = product_difference(dv2, edge1, dv1 * edge2) * (
            np.float32(1.0) / determinant
        )
    other = first_tangents(face_normals(edge1, edge2))
    return np.ascontiguousarray(np.where(determinant != 0.0, along_u, other))
