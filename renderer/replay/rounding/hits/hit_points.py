"""Stage 3 in a replay: the surface points as Mitsuba rounds them.

A mirror ball multiplies the distance of two paths by ten at each bounce, and (u, v) on a
floor of 140 x 140 are known to 8e-6. With other roundings a path would leave Mitsuba's path
after a few bounces. So the points of hits are rounded as Mitsuba and Embree do it. Which
operations are fused, and in which order sums are taken, was found by trying; a test
(tests/replay/test_replay_hits.py) compares bits.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.vectors import column, dot
from renderer.replay.rounding.hits.curved_hits import on_cylinder, on_disk, on_sphere
from renderer.replay.rounding.hits.flat_hits import on_rectangle, on_triangle
from renderer.replay.rounding.hits.instance_space import (
    embree_ray,
    mitsuba_ray,
    placed_normal,
    placed_point,
    placed_vector,
)
from renderer.replay.rounding.hits.surfaces import HitPoint

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
# What differs by more is no rounding: it stays, so that a replay shows it. The largest
# difference that a scene of ours has is 1e-5, on a floor 140 wide.
ROUNDING = np.float32(1e-4)


@kernel
def _of_kind(surfaces, prim):
    return prim >= surfaces.first and prim < surfaces.end


@kernel
def _is_known(surfaces, prim):
    return (
        _of_kind(surfaces.triangles, prim)
        or _of_kind(surfaces.rectangles, prim)
        or _of_kind(surfaces.disks, prim)
        or _of_kind(surfaces.spheres, prim)
        or _of_kind(surfaces.cylinders, prim)
    )


@kernel
def _try_triangles(triangles, vertices, prim, ray, grouped, found):
    if not _of_kind(triangles, prim):
        return found
    k = prim - triangles.first
    return on_triangle(triangles, vertices, k, ray, grouped)


@kernel
def _try_rectangles(rectangles, replayed, prim, u, v, ray, grouped, found):
    if not _of_kind(rectangles, prim):
        return found
    k = prim - rectangles.first
    return on_rectangle(replayed, k, u, v, ray, grouped)


@kernel
def _try_flat(surfaces, replayed, prim, u, v, ray, grouped, found):
    triangles, rectangles = surfaces.triangles, surfaces.rectangles
    found = _try_triangles(triangles, replayed.triangles, prim, ray, grouped, found)
    return _try_rectangles(rectangles, replayed, prim, u, v, ray, grouped, found)


@kernel
def _try_disks(disks, matrices, prim, probe, ray, found):
    if not _of_kind(disks, prim):
        return found
    return on_disk(matrices, disks, prim - disks.first, probe, ray)


@kernel
def _try_spheres(spheres, prim, probe, ray, found):
    if not _of_kind(spheres, prim):
        return found
    return on_sphere(spheres, prim - spheres.first, probe, ray)


@kernel
def _try_cylinders(cylinders, matrices, prim, probe, ray, found):
    if not _of_kind(cylinders, prim):
        return found
    return on_cylinder(matrices, prim - cylinders.first, probe, ray)


@kernel
def _instance_number(placements, numbers, ray):
    if placements.group.size == 0:
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
def _round_normal(rows, i, a):
    """Replace the unit normal in column i, which keeps its side of the surface."""
    if dot(column(rows, i), a) < _ZERO:
        a = -a
    _round(rows, i, a)


@kernel
def _round_frame(rounding, placements, prim, instance, found, points, i):
    """Round both normals and dp/du."""
    matrices = rounding.exact.instances
    _round_normal(points.normal, i, placed_normal(matrices, instance, found.normal))
    normal = placed_normal(matrices, instance, found.vertex_normal)
    _round_normal(points.shading_normal, i, normal)
    if instance < 0 and _of_kind(rounding.surfaces.triangles, prim):
        return  # dp/du is what the mesh has
    tangent = placed_vector(placements, instance, found.tangent)
    _replace_tangent(points.tangent, i, tangent)


@method_kernel
def round_surface_points(rounding, placements, rays, hits, order, count, points):
    """Compute the first `count` surface points anew, with Mitsuba's roundings.

    Also keep the exact position that each path came from.
    """
    exact, surfaces = rounding.exact, rounding.surfaces
    for i in range(count):
        ray = order[i]
        for c in range(3):
            points.previous[c, i] = rays.previous[c, ray]
        prim, u, v = hits.prim[ray], hits.u[ray], hits.v[ray]
        if not _is_known(surfaces, prim):
            continue  # it keeps our roundings
        instance = _instance_number(placements, hits.instance, ray)
        o, d = column(rays.origin, ray), column(rays.direction, ray)
        probe = embree_ray(exact.instances, instance, o, d)
        seen = mitsuba_ray(exact.instances, instance, o, d)
        n = column(points.normal, i)
        found = HitPoint(column(points.position, i), n, n, n, u, v)
        found = _try_flat(surfaces, exact, prim, u, v, probe, instance >= 0, found)
        found = _try_disks(surfaces.disks, exact.disks, prim, probe, seen, found)
        found = _try_spheres(surfaces.spheres, prim, probe, seen, found)
        found = _try_cylinders(
            surfaces.cylinders, exact.cylinders, prim, probe, seen, found
        )
        _round(points.position, i, placed_point(placements, instance, found.position))
        if _of_kind(surfaces.triangles, prim) or _of_kind(surfaces.rectangles, prim):
            _round_uv(points.uv, i, found.u, found.v)
        _round_frame(rounding, placements, prim, instance, found, points, i)
