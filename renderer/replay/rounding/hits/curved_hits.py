"""Hits on spheres, cylinders and disks, as Mitsuba rounds them.

- spheres and cylinders: t in double precision; the point goes onto the surface;
- disks: t in the disk's own space; the point goes onto the plane.

Each agreed in all bits with Mitsuba 3.9.1 on 500 to 3000 hits, where no rotation has
rounded its radius or matrix first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot, vec3
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.flat.disk import DiskSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.replay.rounding.arithmetic.fused import fused_multiply_add
from renderer.replay.rounding.arithmetic.reciprocal import reciprocal_in_matrices
from renderer.replay.rounding.arithmetic.rounded_once import (
    fused_affine,
    fused_cross,
    fused_sum,
    times_point,
    times_vector,
    unit,
)
from renderer.replay.rounding.hits.exact_hits import (
    EXACT,
    HitPoint,
    both_matrices,
    exact_hit,
)
from renderer.replay.rounding.hits.flat_hits import column3

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_TWO_PI = np.float32(2.0 * np.pi)


class ExactDisks(NamedTuple):
    """Disks as Mitsuba has them."""

    places: NDArray[np.float32]  # (12, n) as in `DiskSurfaces`
    matrices: NDArray[np.float32]  # (24, n), see `both_matrices`


class ExactCylinders(NamedTuple):
    """Cylinders as Mitsuba has them."""

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
    """Return t of the nearer hit ahead, as Mitsuba finds it.

    From the point of the ray next to the centre on, in double precision; but that point
    itself is rounded to single.
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
    """Return dp/du on a sphere, which turns about its local z axis."""
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
    """Return t of the hit on the tube x^2 + y^2 = 1 that is the nearer with 0 <= z <= 1."""
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
