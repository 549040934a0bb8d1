"""Stage 3 in a replay: the surface points as Mitsuba rounds them.

A mirror ball multiplies the distance of two paths by ten at each bounce, and (u, v) on a
floor of 140 x 140 are known to 8e-6. With roundings of its own a path would leave its twin
after a few bounces; so the points of hits are rounded as Mitsuba and Embree do it:

- triangles, and rectangles as two of them: Embree's robust test by Plücker coordinates
  [Davidovic2012], then the vertices weighted by (1 - u - v, u, v);
- spheres and cylinders: t in double precision; the point goes onto the surface;
- disks: t in the disk's own space; the point goes onto the plane.

Which operations are fused, and in which order sums are taken, was found by trying: each
kind agreed in all bits with Mitsuba 3.9.1 on 500 to 3000 hits [run].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.affine import affine_at, times
from renderer.jit import kernel, never_inline
from renderer.replay.fused import fused_multiply_add
from renderer.replay.rounded_once import (
    fused_affine,
    fused_cross,
    fused_dot,
    fused_sum,
    times_point,
    times_vector,
    unit,
)
from renderer.vectors import column, dot, vec3

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_TWO_PI = np.float32(2.0 * np.pi)
# What differs by more is no rounding: it stays, so that a replay shows it. The largest
# difference that a scene of ours has is 1e-5, on a floor 140 wide.
ROUNDING = np.float32(1e-4)


class HitPoint(NamedTuple):
    """What Mitsuba knows of a hit, as scalars; valid is what the kind of surface has."""

    position: Any
    normal: Any  # unit: outwards of a curved surface, interpolated on a smooth mesh
    tangent: Any  # dp/du of rectangles and curved surfaces, and of disks
    u: Any  # texture coordinates of triangles and rectangles
    v: Any


@kernel
def _columns3(rows, first, k):
    return vec3(rows[first, k], rows[first + 1, k], rows[first + 2, k])


@kernel
def _barycentric(a, b, c, origin, direction):
    """Return (u, v), the weights of b and c where the ray meets the triangle's plane."""
    a, b, c = a - origin, b - origin, c - origin
    u = fused_dot(fused_cross(c - a, c + a), direction)
    v = fused_dot(fused_cross(a - b, a + b), direction)
    w = fused_dot(fused_cross(b - c, b + c), direction)
    inverse = _ONE / ((u + v) + w)
    return u * inverse, v * inverse


@kernel
def _weighted(rows, k, w, u, v):
    """Return the weighted sum of three vectors in a column, the first one last."""
    a, b, c = _columns3(rows, 0, k), _columns3(rows, 3, k), _columns3(rows, 6, k)
    return fused_sum(a, w, fused_sum(b, u, c * v))


@kernel
def _texture_coordinate(uvs, row, k, w, u, v):
    """Return one weighted texture coordinate, the third one last."""
    first = fused_multiply_add(uvs[row + 2, k], u, uvs[row, k] * w)
    return fused_multiply_add(uvs[row + 4, k], v, first)


@kernel
def _with_uv(uvs, k, w, u, v):
    if uvs is None:
        return u, v
    return (
        _texture_coordinate(uvs, 0, k, w, u, v),
        _texture_coordinate(uvs, 1, k, w, u, v),
    )


@kernel
def _vertex_normal(normals, k, w, u, v, flat):
    if normals is None:
        return flat
    a, b, c = _columns3(normals, 0, k), _columns3(normals, 3, k), _columns3(normals, 6, k)
    return unit(fused_sum(c, v, fused_sum(b, u, a * w)))


@kernel
def _on_triangle(triangles, vertices, k, origin, direction):
    a, b, c = (
        _columns3(vertices, 0, k),
        _columns3(vertices, 3, k),
        _columns3(vertices, 6, k),
    )
    u, v = _barycentric(a, b, c, origin, direction)
    w = (_ONE - u) - v
    flat = column(triangles.normal, k)
    normal = _vertex_normal(triangles.normals, k, w, u, v, flat)
    texture_u, texture_v = _with_uv(triangles.uvs, k, w, u, v)
    return HitPoint(_weighted(vertices, k, w, u, v), normal, normal, texture_u, texture_v)


@kernel
def _on_rectangle(replayed, k, u, v, origin, direction):
    """Return the point on the half with the vertices (10, 01, 00), or (10, 11, 01)."""
    far = u + v > _ONE
    half = 2 * k + (1 if far else 0)
    vertices = replayed.rectangles
    a, b, c = (
        _columns3(vertices, 0, half),
        _columns3(vertices, 3, half),
        _columns3(vertices, 6, half),
    )
    u, v = _barycentric(a, b, c, origin, direction)
    w = (_ONE - u) - v
    position = _weighted(vertices, half, w, u, v)
    normal = column(replayed.rectangle_normals, half)
    tangent = column(replayed.rectangle_tangents, half)
    if far:
        return HitPoint(position, normal, tangent, w + u, u + v)
    return HitPoint(position, normal, tangent, w, u)


@kernel
def _on_disk(matrices, disks, k, origin, direction):
    center, normal = column(disks.corner, k), column(disks.normal, k)
    o = times_point(matrices, 12, k, origin)
    d = times_vector(matrices, 12, k, direction)
    t = -o.z / d.z
    x, y = fused_multiply_add(d.x, t, o.x), fused_multiply_add(d.y, t, o.y)
    inverse = _ONE / np.sqrt(fused_multiply_add(x, x, y * y))
    outwards = vec3(x * inverse, y * inverse, _ZERO)
    point = fused_sum(direction, t, origin)
    position = fused_sum(normal, dot(center - point, normal), point)
    return HitPoint(position, normal, times_vector(matrices, 0, k, outwards), t, t)


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
    x_axis, y_axis = _columns3(spheres.frame, 0, k), _columns3(spheres.frame, 3, k)
    inverse = _ONE / radius
    x = fused_affine(x_axis * inverse, -dot(x_axis * inverse, center), p)
    y = fused_affine(y_axis * inverse, -dot(y_axis * inverse, center), p)
    return fused_sum(y_axis * radius, x, x_axis * (radius * -y)) * _TWO_PI


@kernel
def _on_sphere(spheres, k, origin, direction):
    center, radius = column(spheres.center, k), spheres.radius[k]
    t = _sphere_distance(center, radius, origin, direction)
    normal = unit(fused_sum(direction, t, origin) - center)
    position = fused_sum(normal, radius, center)
    tangent = _sphere_tangent(spheres, k, center, radius, position)
    return HitPoint(position, normal, tangent, t, t)


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


@kernel
def _on_cylinder(matrices, k, origin, direction):
    t = _cylinder_distance(
        times_point(matrices, 12, k, origin), times_vector(matrices, 12, k, direction)
    )
    point = fused_sum(direction, t, origin)
    local = times_point(matrices, 12, k, point)
    around = vec3(-local.y * _TWO_PI, local.x * _TWO_PI, _ZERO)
    tangent = times_vector(matrices, 0, k, around)
    along = times_vector(matrices, 0, k, vec3(_ZERO, _ZERO, _ONE))
    normal = unit(fused_cross(tangent, along))
    radius = np.sqrt(fused_multiply_add(local.x, local.x, local.y * local.y))
    return HitPoint(fused_sum(normal, _ONE - radius, point), normal, tangent, t, t)


@kernel
def _of_kind(surfaces, prim):
    return prim >= surfaces.first and prim < surfaces.end


@kernel
def _try_triangles(triangles, vertices, prim, o, d, found):
    if triangles is None:
        return found
    if not _of_kind(triangles, prim):
        return found
    return _on_triangle(triangles, vertices, prim - triangles.first, o, d)


@kernel
def _try_rectangles(rectangles, replayed, prim, u, v, o, d, found):
    if rectangles is None:
        return found
    if not _of_kind(rectangles, prim):
        return found
    return _on_rectangle(replayed, prim - rectangles.first, u, v, o, d)


@kernel
def _try_disks(disks, matrices, prim, o, d, found):
    if disks is None:
        return found
    if not _of_kind(disks, prim):
        return found
    return _on_disk(matrices, disks, prim - disks.first, o, d)


@kernel
def _try_spheres(spheres, prim, o, d, found):
    if spheres is None:
        return found
    if not _of_kind(spheres, prim):
        return found
    return _on_sphere(spheres, prim - spheres.first, o, d)


@kernel
def _try_cylinders(cylinders, matrices, prim, o, d, found):
    if cylinders is None:
        return found
    if not _of_kind(cylinders, prim):
        return found
    return _on_cylinder(matrices, prim - cylinders.first, o, d)


@kernel
def _into_object(instances, instance, origin, direction):
    if instances is None:
        return origin, direction
    if instance < 0:
        return origin, direction
    m = affine_at(instances.placements.to_object, instance)
    return times(m, origin - m.at), times(m, direction)


@kernel
def _into_world(instances, instance, p):
    if instances is None:
        return p
    if instance < 0:
        return p
    m = affine_at(instances.placements.to_world, instance)
    return vec3(
        fused_affine(m.x, m.at.x, p),
        fused_affine(m.y, m.at.y, p),
        fused_affine(m.z, m.at.z, p),
    )


@kernel
def _instance_number(numbers, ray):
    if numbers is None:
        return np.int32(-1)
    return numbers[ray]


@kernel
def _round(rows, i, a):
    """Replace the vector in column i by `a` if rounding explains the difference."""
    old = column(rows, i)
    limit = ROUNDING * (_ONE + max(abs(old.x), max(abs(old.y), abs(old.z))))
    x, y, z = abs(a.x - old.x), abs(a.y - old.y), abs(a.z - old.z)
    if x <= limit and y <= limit and z <= limit:
        rows[0, i], rows[1, i], rows[2, i] = a.x, a.y, a.z


@kernel
def _replace_tangent(tangents, i, a):
    """Replace a tangent by one of the same direction; the old one has another length."""
    old = column(tangents, i)
    scale = np.sqrt(dot(old, old) / dot(a, a))
    limit = ROUNDING * np.sqrt(dot(old, old))
    x, y, z = abs(a.x * scale - old.x), abs(a.y * scale - old.y), abs(a.z * scale - old.z)
    if x <= limit and y <= limit and z <= limit:
        tangents[0, i], tangents[1, i], tangents[2, i] = a.x, a.y, a.z


@kernel
def _round_uv(uv, i, u, v):
    apart = max(abs(uv[0, i] - u), abs(uv[1, i] - v))
    if apart <= ROUNDING * (_ONE + max(abs(u), abs(v))):
        uv[0, i], uv[1, i] = u, v


@kernel
def _round_frame(surfaces, prim, found, orientation, points, i):
    """Round normals and dp/du, where they depend on where a surface is hit."""
    if _is_smooth(surfaces.triangles, prim):
        _round(points.shading_normal, i, found.normal)
    elif not _has(surfaces.triangles, prim):
        _round(points.normal, i, found.normal * orientation)
        _round(points.shading_normal, i, found.normal * orientation)
        _replace_tangent(points.tangent, i, found.tangent)


@kernel
def _has(surfaces, prim):
    if surfaces is None:
        return False
    return _of_kind(surfaces, prim)


@kernel
def _is_smooth(triangles, prim):
    if triangles is None:
        return False
    return _with_normals(triangles.normals) and _of_kind(triangles, prim)


@kernel
def _with_normals(normals):
    return normals is not None


@kernel
def as_mitsuba_rounds(replayed, scene, rays, hits, order, count, points):
    """Compute the first `count` surface points anew, if this is a replay.

    Parameters
    ----------
    replayed : ReplaySurfaces or None
        None: this is none.
    scene, rays, hits, order, count, points
        As `surface_points` has them; `points` is filled.
    """
    if replayed is None:
        return
    never_inline()  # it is called from two stages, and compiling it twice takes seconds
    surfaces, instances = scene.surfaces, scene.accelerators.instances
    for i in range(count):
        ray = order[i]
        prim, u, v = hits.prim[ray], hits.u[ray], hits.v[ray]
        instance = _instance_number(hits.instance, ray)
        o, d = column(rays.origin, ray), column(rays.direction, ray)
        o, d = _into_object(instances, instance, o, d)
        n = column(points.normal, i)
        found = HitPoint(column(points.position, i), n, n, u, v)
        found = _try_triangles(surfaces.triangles, replayed.triangles, prim, o, d, found)
        found = _try_rectangles(surfaces.rectangles, replayed, prim, u, v, o, d, found)
        found = _try_disks(surfaces.disks, replayed.disks, prim, o, d, found)
        found = _try_spheres(surfaces.spheres, prim, o, d, found)
        found = _try_cylinders(surfaces.cylinders, replayed.cylinders, prim, o, d, found)
        _round(points.position, i, _into_world(instances, instance, found.position))
        if _has(surfaces.triangles, prim) or _has(surfaces.rectangles, prim):
            _round_uv(points.uv, i, found.u, found.v)
        if instance < 0:
            orientation = scene.shapes.orientation[scene.shape[prim]]
            _round_frame(surfaces, prim, found, orientation, points, i)
