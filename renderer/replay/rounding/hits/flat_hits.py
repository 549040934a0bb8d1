"""Hits on triangles, and on rectangles as two of them, as Embree and Mitsuba round them.

(u, v) by Embree's robust test, which uses Plücker coordinates [Davidovic2012]; but inside
of groups by its fast one [Moeller1997], since Mitsuba sets the robust flag for the
structure of the scene only. Then the vertices weighted by (1 - u - v, u, v). Each agreed in
all bits with Mitsuba 3.9.1 on thousands of hits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, vec3
from renderer.plugins.shapes.flat.rectangle import RectangleSurfaces
from renderer.plugins.shapes.flat.triangle import TriangleSurfaces
from renderer.replay.rounding.arithmetic.fused import fused_multiply_add
from renderer.replay.rounding.arithmetic.reciprocal import reciprocal
from renderer.replay.rounding.arithmetic.rounded_once import (
    fused_cross,
    fused_dot,
    fused_sum,
    unit,
)
from renderer.replay.rounding.hits.exact_hits import EXACT, HitPoint, exact_hit
from renderer.replay.rounding.hits.triangle_arithmetic import face_normals, uv_tangents
from renderer.scene_file.description import Mesh, Rectangle
from renderer.scene_file.transforms import place_normals, place_points

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@kernel
def column3(rows, first, k):
    """Return the vector in three rows of column k."""
    return vec3(rows[first, k], rows[first + 1, k], rows[first + 2, k])


@kernel
def column9(rows, first, k):
    """Return the three vectors in nine rows of column k."""
    return column3(rows, first, k), column3(rows, first + 3, k), column3(rows, first + 6, k)


@kernel
def _barycentric_robust(a, b, c, direction):
    """Return (u, v) from vertices relative to the ray's origin."""
    u = fused_dot(fused_cross(c - a, c + a), direction)
    v = fused_dot(fused_cross(a - b, a + b), direction)
    w = fused_dot(fused_cross(b - c, b + c), direction)
    inverse = reciprocal((u + v) + w)
    return u * inverse, v * inverse


@kernel
def _barycentric_fast(a, edge1, edge2, direction):
    """Return (u, v) from a vertex relative to the ray's origin, and edges a - b, c - a."""
    determinant = fused_dot(fused_cross(edge2, edge1), direction)
    across = fused_cross(a, direction)
    sign = _ONE if determinant > _ZERO else -_ONE
    inverse = sign * reciprocal(sign * determinant)
    return fused_dot(across, edge2) * inverse, fused_dot(across, edge1) * inverse


@kernel
def _barycentric(a, b, c, origin, direction, grouped):
    """Return (u, v), the weights of b and c where the ray meets the triangle's plane."""
    if grouped:
        return _barycentric_fast(a - origin, a - b, c - a, direction)
    return _barycentric_robust(a - origin, b - origin, c - origin, direction)


@kernel
def _weighted(rows, k, w, u, v):
    """Return the weighted sum of three vectors in a column, the first one last."""
    a, b, c = column9(rows, 0, k)
    return fused_sum(a, w, fused_sum(b, u, c * v))


@kernel
def _texture_coordinate(uvs, row, k, w, u, v):
    """Return one weighted texture coordinate, the third one last."""
    first = fused_multiply_add(uvs[row + 2, k], u, uvs[row, k] * w)
    return fused_multiply_add(uvs[row + 4, k], v, first)


@kernel
def _with_uv(uvs, k, w, u, v):
    if uvs.shape[1] == 0:
        return u, v
    return (
        _texture_coordinate(uvs, 0, k, w, u, v),
        _texture_coordinate(uvs, 1, k, w, u, v),
    )


@kernel
def _interpolated_normal(a, b, c, w, u, v):
    return unit(fused_sum(c, v, fused_sum(b, u, a * w)))


@kernel
def _vertex_normal(normals, k, w, u, v, flat):
    if normals.shape[1] == 0:
        return flat
    a, b, c = column9(normals, 0, k)
    return _interpolated_normal(a, b, c, w, u, v)


class ExactTriangles(NamedTuple):
    """Triangles as Mitsuba has them."""

    surfaces: TriangleSurfaces
    vertices: NDArray[np.float32]  # (9, n) three vertices in turn


def _exact_triangles(surfaces: TriangleSurfaces, meshes: Sequence[Mesh]) -> ExactTriangles:
    corners = [mesh.vertices[mesh.faces].reshape(-1, 9).T for mesh in meshes]
    return ExactTriangles(surfaces, np.ascontiguousarray(np.hstack(corners), "f4"))


@exact_hit.by(ExactTriangles)
@kernel
def _on_triangle(shapes, k, u, v, ray, mitsuba_ray, grouped):
    triangles, vertices = shapes.surfaces, shapes.vertices
    a, b, c = column9(vertices, 0, k)
    u, v = _barycentric(a, b, c, ray.origin, ray.direction, grouped)
    w = (_ONE - u) - v
    flat = column3(triangles.places, 9, k)
    smooth = _vertex_normal(triangles.normals, k, w, u, v, flat)
    tangent = column(triangles.tangents, k)
    texture_u, texture_v = _with_uv(triangles.uvs, k, w, u, v)
    position = _weighted(vertices, k, w, u, v)
    return HitPoint(position, flat, smooth, tangent, texture_u, texture_v)


class ExactRectangles(NamedTuple):
    """Two triangles for each rectangle; columns by half."""

    vertices: NDArray[np.float32]  # (9, 2 n)
    normals: NDArray[np.float32]  # (3, 2 n) unit
    vertex_normals: NDArray[np.float32]  # (3, 2 n) unit
    tangents: NDArray[np.float32]  # (3, 2 n) dp/du


def _exact_rectangles(surfaces: Any, shapes: Sequence[Rectangle]) -> ExactRectangles:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    placed = np.array([place_points(shape.to_world, corners) for shape in shapes])
    halves = placed[:, [[1, 2, 0], [1, 3, 2]]]  # (n, half, vertex, xyz)
    vertices = np.ascontiguousarray(halves.reshape(-1, 9).T)
    edges = vertices[3:6] - vertices[0:3], vertices[6:9] - vertices[0:3]
    up = np.array([[0, 0, 1]])
    normals = [place_normals(shape.to_world, up) for shape in shapes]
    # the uv of the halves run over the whole rectangle
    uvs = np.array([[1, 0, 0, 1, 0, 0], [1, 0, 1, 1, 0, 1]], np.float32)
    return ExactRectangles(
        vertices,
        face_normals(*edges),
        np.ascontiguousarray(np.repeat(np.concatenate(normals), 2, axis=0).T),
        uv_tangents(*edges, np.tile(uvs.T, len(shapes))),
    )


@exact_hit.by(ExactRectangles)
@kernel
def _on_rectangle(rectangles, k, u, v, ray, mitsuba_ray, grouped):
    """Return the hit on the half with the vertices (10, 01, 00), or (10, 11, 01)."""
    far = u + v > _ONE
    half = 2 * k + (1 if far else 0)
    a, b, c = column9(rectangles.vertices, 0, half)
    u, v = _barycentric(a, b, c, ray.origin, ray.direction, grouped)
    w = (_ONE - u) - v
    position = _weighted(rectangles.vertices, half, w, u, v)
    normal = column(rectangles.normals, half)
    n = column(rectangles.vertex_normals, half)
    smooth = _interpolated_normal(n, n, n, w, u, v)
    tangent = column(rectangles.tangents, half)
    if far:
        return HitPoint(position, normal, smooth, tangent, w + u, u + v)
    return HitPoint(position, normal, smooth, tangent, w, u)


EXACT[TriangleSurfaces] = _exact_triangles
EXACT[RectangleSurfaces] = _exact_rectangles
