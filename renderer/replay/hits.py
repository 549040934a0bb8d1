"""Hits of flat and curved shapes, with Mitsuba's rounding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import affine_at, column, dot, vec3
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.disk import DiskSurfaces
from renderer.plugins.shapes.rectangle import RectangleSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces
from renderer.replay.arithmetic import (
    fused_affine,
    fused_cross,
    fused_dot,
    fused_multiply_add,
    fused_sum,
    fused_times,
    reciprocal,
    reciprocal_in_matrices,
    times_point,
    times_vector,
    unit,
)
from renderer.replay.exact_hits import (
    EXACT,
    HitPoint,
    both_matrices,
    exact_hit,
    face_normals,
    uv_tangents,
)
from renderer.scene_file.description import Mesh, Rectangle
from renderer.scene_file.transforms import place_normals, place_points

# ----------------------------------------------------------------------- instance space
# Transforms into an instance and back, with the rounding of Embree and Mitsuba.
#
# Embree finds t and (u, v) with its own object-space ray. Mitsuba transforms by another
# inverse, and evaluates its ray at Embree's t. Both agreed with Mitsuba in all bits.
# `matrices` are from `instance_matrices`; `instance` is -1 outside of instances.


class ObjectRay(NamedTuple):
    """A ray in the space of the object that it hits, as scalars."""

    origin: Any
    direction: Any


@kernel
def embree_ray(matrices, instance, origin, direction):
    """Return the object-space ray with which Embree intersects."""
    if instance < 0:
        return ObjectRay(origin, direction)
    x, y, z = column9(matrices, 0, instance)
    at = column3(matrices, 9, instance)
    o = fused_sum(y, origin.y, fused_sum(z, origin.z, at))
    d = fused_sum(y, direction.y, z * direction.z)
    return ObjectRay(fused_sum(x, origin.x, o), fused_sum(x, direction.x, d))


@kernel
def mitsuba_ray(matrices, instance, origin, direction):
    """Return the object-space ray that Mitsuba evaluates at Embree's t."""
    if instance < 0:
        return ObjectRay(origin, direction)
    x, y, z = column9(matrices, 12, instance)
    at = column3(matrices, 21, instance)
    o = fused_sum(z, origin.z, fused_sum(y, origin.y, fused_sum(x, origin.x, at)))
    d = fused_sum(z, direction.z, fused_sum(y, direction.y, x * direction.x))
    return ObjectRay(o, d)


@kernel
def placed_point(placements, instance, p):
    """Return an object-space point in the world."""
    if instance < 0:
        return p
    m = affine_at(placements.to_world, instance)
    return vec3(
        fused_affine(m.x, m.at.x, p),
        fused_affine(m.y, m.at.y, p),
        fused_affine(m.z, m.at.z, p),
    )


@kernel
def placed_vector(placements, instance, a):
    """Return an object-space vector in the world."""
    if instance < 0:
        return a
    m = affine_at(placements.to_world, instance)
    return fused_times(m.x, m.y, m.z, a)


@kernel
def placed_normal(matrices, instance, n):
    """Return an object-space unit normal in the world, unit."""
    if instance < 0:
        return n
    x, y, z = column9(matrices, 12, instance)
    return unit(fused_times(x, y, z, n))


# ---------------------------------------------------------------------------- flat hits
# Hits on triangles, and on rectangles as two triangles, rounded as by Embree and Mitsuba.
#
# (u, v) is from Embree's robust test with Plücker coordinates [Davidovic2012]. In groups
# it is from the fast test [Moeller1997], since Mitsuba sets the robust flag for the main
# scene only. The position is then the vertices weighted by (1 - u - v, u, v). Each agreed
# with Mitsuba in all bits on thousands of hits.

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
    """Return the weighted sum of three vectors in a column, the first one added last."""
    a, b, c = column9(rows, 0, k)
    return fused_sum(a, w, fused_sum(b, u, c * v))


@kernel
def _texture_coordinate(uvs, row, k, w, u, v):
    """Return one weighted texture coordinate, the third one added last."""
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
    """Triangles with Mitsuba's numbers."""

    surfaces: TriangleSurfaces
    vertices: NDArray[np.float32]  # (9, n) three vertices in sequence


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
    # uv over the whole rectangle
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


# -------------------------------------------------------------------------- curved hits
# Hits on spheres, cylinders and disks, with Mitsuba's rounding.
#
# - spheres and cylinders: t in double precision; the point is projected to the surface;
# - disks: t in the disk's object space; the point is projected to the plane.
#
# Each agreed with Mitsuba in all bits on 500 to 3000 hits, unless a rotation had already
# rounded its radius or matrix.

_TWO_PI = np.float32(2.0 * np.pi)


class ExactDisks(NamedTuple):
    """Disks with Mitsuba's numbers."""

    places: NDArray[np.float32]  # (12, n) as in `DiskSurfaces`
    matrices: NDArray[np.float32]  # (24, n), see `both_matrices`


class ExactCylinders(NamedTuple):
    """Cylinders with Mitsuba's numbers."""

    matrices: NDArray[np.float32]  # (24, n), see `both_matrices`


EXACT[DiskSurfaces] = lambda disks, shapes: ExactDisks(
    np.ascontiguousarray(disks.places), both_matrices(shapes)
)
EXACT[SphereSurfaces] = lambda spheres, shapes: spheres
EXACT[CylinderSurfaces] = lambda _, shapes: ExactCylinders(both_matrices(shapes))


@exact_hit.by(ExactDisks)
@kernel
def _on_disk(disks, k, u, v, probe, ray, grouped):
    center, normal = column3(disks.places, 0, k), column3(disks.places, 9, k)
    matrices = disks.matrices
    o = times_point(matrices, 12, k, probe.origin)
    d = times_vector(matrices, 12, k, probe.direction)
    t = -o.z / d.z
    x, y = fused_multiply_add(d.x, t, o.x), fused_multiply_add(d.y, t, o.y)
    inverse = _ONE / np.sqrt(fused_multiply_add(x, x, y * y))
    outwards = vec3(x * inverse, y * inverse, _ZERO)
    point = fused_sum(ray.direction, t, ray.origin)
    position = fused_sum(normal, dot(center - point, normal), point)
    tangent = times_vector(matrices, 0, k, outwards)
    return HitPoint(position, normal, normal, tangent, None, None)


@kernel
def _in_double(a):
    return vec3(np.float64(a.x), np.float64(a.y), np.float64(a.z))


@kernel
def _sphere_distance(center, radius, origin, direction):
    """Return t of the nearest hit ahead, as Mitsuba computes it.

    It is in double precision, relative to the ray's point nearest to the centre. That point
    itself is rounded to single precision.
    """
    d = _in_double(direction)
    length2 = dot(d, d)
    ahead = dot(_in_double(center) - _in_double(origin), d) / np.sqrt(length2)
    o = _in_double(fused_sum(direction, np.float32(ahead), origin)) - _in_double(center)
    half_b = dot(o, d)
    c = dot(o, o) - np.float64(radius) * np.float64(radius)
    root = np.sqrt(max(half_b * half_b - length2 * c, 0.0))
    q = -(half_b + (root if half_b >= 0.0 else -root))
    first, second = q / length2 + ahead, c / q + ahead
    near, far = min(first, second), max(first, second)
    return np.float32(far if near < 0.0 else near)


@kernel
def _sphere_tangent(spheres, k, center, radius, p):
    """Return dp/du on a sphere, around its local z axis."""
    x_axis, y_axis = column3(spheres.frame, 0, k), column3(spheres.frame, 3, k)
    inverse = reciprocal_in_matrices(radius)
    x = fused_affine(x_axis * inverse, -dot(x_axis * inverse, center), p)
    y = fused_affine(y_axis * inverse, -dot(y_axis * inverse, center), p)
    return fused_sum(y_axis * radius, x, x_axis * (radius * -y)) * _TWO_PI


@exact_hit.by(SphereSurfaces)
@kernel
def _on_sphere(spheres, k, u, v, probe, ray, grouped):
    center, radius = column(spheres.center, k), spheres.radius[k]
    t = _sphere_distance(center, radius, probe.origin, probe.direction)
    normal = unit(fused_sum(ray.direction, t, ray.origin) - center)
    position = fused_sum(normal, radius, center)
    tangent = _sphere_tangent(spheres, k, center, radius, position)
    return HitPoint(position, normal, normal, tangent, None, None)


@kernel
def _cylinder_distance(o, d):
    """Return t of the nearest hit on the tube x^2 + y^2 = 1 with 0 <= z <= 1."""
    o, d = _in_double(o), _in_double(d)
    a = d.x * d.x + d.y * d.y
    half_b = d.x * o.x + d.y * o.y
    root = np.sqrt(max(half_b * half_b - a * (o.x * o.x + o.y * o.y - 1.0), 0.0))
    q = -(half_b + (root if half_b >= 0.0 else -root))
    first, second = q / a, (o.x * o.x + o.y * o.y - 1.0) / q
    near, far = min(first, second), max(first, second)
    z = o.z + d.z * near
    return np.float32(near if near >= 0.0 and 0.0 <= z <= 1.0 else far)


@exact_hit.by(ExactCylinders)
@kernel
def _on_cylinder(cylinders, k, u, v, probe, ray, grouped):
    matrices = cylinders.matrices
    t = _cylinder_distance(
        times_point(matrices, 12, k, probe.origin),
        times_vector(matrices, 12, k, probe.direction),
    )
    point = fused_sum(ray.direction, t, ray.origin)
    local = times_point(matrices, 12, k, point)
    around = vec3(-local.y * _TWO_PI, local.x * _TWO_PI, _ZERO)
    tangent = times_vector(matrices, 0, k, around)
    along = times_vector(matrices, 0, k, vec3(_ZERO, _ZERO, _ONE))
    normal = unit(fused_cross(tangent, along))
    radius = np.sqrt(fused_multiply_add(local.x, local.x, local.y * local.y))
    position = fused_sum(normal, _ONE - radius, point)
    return HitPoint(position, normal, normal, tangent, None, None)
