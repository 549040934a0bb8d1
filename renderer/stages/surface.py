"""Stage 3, the surface at a hit: position, normals, uv, and how uncertain the position is.

Positions come from the primitive (corner + u edge1 + v edge2, centre + r n), not from
p + t d: their error then does not grow with the distance that the ray has come.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.jit import kernel
from renderer.lanes.functions import (
    first_lanes,
    mask_bits,
    select,
    splat_f32,
    sqrt,
)
from renderer.lanes.mathematics import arccos, arctan2
from renderer.lanes.memory import gather_row, load_row, store_row
from renderer.replay.hit_points import as_mitsuba_rounds
from renderer.sampling import TWO_PI
from renderer.stages.placement import (
    ROUNDING,
    Place,
    in_world,
    instance_of,
    magnitude,
    object_hit_point,
)
from renderer.stages.tangent import store_tangents
from renderer.vectors import dot, gather3, gather_rows3, normalize, select3, store3, vec3

_INV_TWO_PI = np.float32(0.5 / np.pi)
_INV_PI = np.float32(1.0 / np.pi)


class Surface(NamedTuple):
    """A surface point in 16 lanes."""

    position: Any
    normal: Any  # geometric, unit, before the shape's orientation
    shading_normal: Any  # unit, final where the mesh has vertex normals
    smooth: Any  # mask: the shading normal comes from vertex normals
    offset: Any  # rounding error of the position
    u: Any
    v: Any


@kernel
def _choose(mask, position, normal, offset, u, v, other):
    """Return the given point where the mask is set, else the `other` surface's."""
    return Surface(
        select3(mask, position, other.position),
        select3(mask, normal, other.normal),
        select3(mask, normal, other.shading_normal),
        other.smooth,
        select(mask, offset, other.offset),
        select(mask, u, other.u),
        select(mask, v, other.v),
    )


@kernel
def interpolated_normal(normals, index, mask, u, v, flat):
    """Return the unit normals between the vertices' own; `flat` where there are none."""
    if normals is None:
        return flat
    return normalize(
        gather_rows3(normals, 0, index, mask) * (1.0 - u - v)
        + gather_rows3(normals, 3, index, mask) * u
        + gather_rows3(normals, 6, index, mask) * v
    )


@kernel
def _with_vertex_normals(normals, index, mask, u, v, surface):
    if normals is None:
        return surface
    n = interpolated_normal(normals, index, mask, u, v, surface.normal)
    return Surface(
        surface.position,
        surface.normal,
        select3(mask, n, surface.shading_normal),
        surface.smooth | mask,
        surface.offset,
        surface.u,
        surface.v,
    )


@kernel
def _interpolated_uv(uvs, index, mask, u, v, surface):
    if uvs is None:
        return surface
    w = 1.0 - u - v
    texture_u = (
        gather_row(uvs, 0, index, mask) * w
        + gather_row(uvs, 2, index, mask) * u
        + gather_row(uvs, 4, index, mask) * v
    )
    texture_v = (
        gather_row(uvs, 1, index, mask) * w
        + gather_row(uvs, 3, index, mask) * u
        + gather_row(uvs, 5, index, mask) * v
    )
    return Surface(
        surface.position,
        surface.normal,
        surface.shading_normal,
        surface.smooth,
        surface.offset,
        select(mask, texture_u, surface.u),
        select(mask, texture_v, surface.v),
    )


@kernel
def _flat_point(patches, index, mask, u, v):
    """Return position, normal and offset on flat primitives."""
    corner = gather3(patches.corner, index, mask)
    edge1 = gather3(patches.edge1, index, mask)
    edge2 = gather3(patches.edge2, index, mask)
    position = corner + edge1 * u + edge2 * v
    size = magnitude(corner) + magnitude(edge1) + magnitude(edge2)
    return position, gather3(patches.normal, index, mask), size * ROUNDING


@kernel
def _on_triangles(triangles, prim, mask, u, v, surface):
    if triangles is None:
        return surface
    mine = mask & (prim >= triangles.first) & (prim < triangles.end)
    if mask_bits(mine) == 0:
        return surface
    index = prim - triangles.first
    position, normal, offset = _flat_point(triangles, index, mine, u, v)
    found = _choose(mine, position, normal, offset, u, v, surface)
    found = _with_vertex_normals(triangles.normals, index, mine, u, v, found)
    return _interpolated_uv(triangles.uvs, index, mine, u, v, found)


@kernel
def _on_rectangles(rectangles, prim, mask, u, v, surface):
    if rectangles is None:
        return surface
    mine = mask & (prim >= rectangles.first) & (prim < rectangles.end)
    if mask_bits(mine) == 0:
        return surface
    index = prim - rectangles.first
    position, normal, offset = _flat_point(rectangles, index, mine, u, v)
    return _choose(mine, position, normal, offset, u, v, surface)


@kernel
def _turn(x, y, with_uv):
    """Return the angle of (x, y) as a fraction of a turn in [0, 1)."""
    if with_uv is None:
        return x * 0.0
    angle = arctan2(y, x)
    return select(angle < 0.0, angle + TWO_PI, angle) * _INV_TWO_PI


@kernel
def _on_disks(disks, prim, mask, u, v, with_uv, surface):
    if disks is None:
        return surface
    mine = mask & (prim >= disks.first) & (prim < disks.end)
    if mask_bits(mine) == 0:
        return surface
    position, normal, offset = _flat_point(disks, prim - disks.first, mine, u, v)
    radius = sqrt(u * u + v * v)
    return _choose(mine, position, normal, offset, radius, _turn(u, v, with_uv), surface)


@kernel
def _polar_uv(frame, index, mask, n, with_uv):
    """Return longitude / 2 pi and colatitude / pi of a direction in the local frame."""
    if with_uv is None:
        return n.x * 0.0, n.x * 0.0
    x = dot(gather_rows3(frame, 0, index, mask), n)
    y = dot(gather_rows3(frame, 3, index, mask), n)
    z = dot(gather_rows3(frame, 6, index, mask), n)
    return _turn(x, y, with_uv), arccos(z) * _INV_PI


@kernel
def _on_spheres(spheres, prim, mask, hit_point, with_uv, surface):
    if spheres is None:
        return surface
    mine = mask & (prim >= spheres.first) & (prim < spheres.end)
    if mask_bits(mine) == 0:
        return surface
    index = prim - spheres.first
    center = gather3(spheres.center, index, mine)
    radius = gather_row(spheres.radius, 0, index, mine)
    normal = normalize(hit_point - center)
    u, v = _polar_uv(spheres.frame, index, mine, normal, with_uv)
    offset = (magnitude(center) + radius) * ROUNDING
    return _choose(mine, center + normal * radius, normal, offset, u, v, surface)


@kernel
def _cylinder_uv(cylinders, index, mask, normal, height, with_uv):
    if with_uv is None:
        return height, height
    x = dot(gather_rows3(cylinders.frame, 0, index, mask), normal)
    y = dot(gather_rows3(cylinders.frame, 3, index, mask), normal)
    return _turn(x, y, with_uv), height


@kernel
def _on_cylinders(cylinders, prim, mask, hit_point, height, with_uv, surface):
    if cylinders is None:
        return surface
    mine = mask & (prim >= cylinders.first) & (prim < cylinders.end)
    if mask_bits(mine) == 0:
        return surface
    index = prim - cylinders.first
    base = gather3(cylinders.base, index, mine)
    axis = gather_rows3(cylinders.frame, 6, index, mine)
    radius = gather_row(cylinders.radius, 0, index, mine)
    length = gather_row(cylinders.height, 0, index, mine)
    from_base = hit_point - base
    along = dot(from_base, axis)
    normal = normalize(from_base - axis * along)
    position = base + axis * along + normal * radius
    u, v = _cylinder_uv(cylinders, index, mine, normal, height, with_uv)
    offset = (magnitude(base) + radius + length) * ROUNDING
    return _choose(mine, position, normal, offset, u, v, surface)


@kernel
def surface_at(surfaces, prim, mask, u, v, hit_point):
    """Return the `Surface` of 16 hits; `hit_point` is p + t d, for the curved kinds."""
    zero = splat_f32(0.0)
    none = vec3(zero, zero, zero)
    s = Surface(none, none, none, zero != zero, zero, zero, zero)
    s = _on_triangles(surfaces.triangles, prim, mask, u, v, s)
    s = _on_rectangles(surfaces.rectangles, prim, mask, u, v, s)
    s = _on_disks(surfaces.disks, prim, mask, u, v, surfaces.with_uv, s)
    s = _on_spheres(surfaces.spheres, prim, mask, hit_point, surfaces.with_uv, s)
    return _on_cylinders(surfaces.cylinders, prim, mask, hit_point, v, surfaces.with_uv, s)


@kernel
def _store_previous(previous, i, rays, ray, valid):
    if previous is None:
        return
    store3(previous, i, gather3(rays.previous, ray, valid))


@kernel
def surface_points(scene, rays, hits, order, count, points):
    """Fill `points` with the hits `order[:count]` and the state of their paths."""
    per_rounding = np.float32(scene.settings.rounding_offset)
    fixed = np.float32(scene.settings.fixed_offset)
    instances = scene.accelerators.instances
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        ray = load_row(order, 0, i)
        prim = gather_row(hits.prim, 0, ray, valid)
        t = gather_row(hits.t, 0, ray, valid)
        u = gather_row(hits.u, 0, ray, valid)
        v = gather_row(hits.v, 0, ray, valid)
        origin = gather3(rays.origin, ray, valid)
        direction = gather3(rays.direction, ray, valid)
        instance = instance_of(instances, hits.instance, ray, valid)
        hit_point = object_hit_point(instances, instance, origin, direction, t)
        s = surface_at(scene.surfaces, prim, valid, u, v, hit_point)
        shape = gather_row(scene.shape, 0, prim, valid)
        orientation = gather_row(scene.shapes.orientation, 0, shape, valid)
        normal = s.normal * orientation
        shading_normal = select3(s.smooth, s.shading_normal, normal)
        place = Place(s.position, normal, shading_normal, s.offset)
        place = in_world(instances, instance, place)
        store3(points.position, i, place.position)
        store3(points.wo, i, -direction)
        store3(points.normal, i, place.normal)
        store3(points.shading_normal, i, place.shading_normal)
        unlike_rounding = (1.0 + magnitude(place.position)) * fixed
        store_tangents(
            points.tangent,
            i,
            scene.surfaces,
            instances,
            instance,
            prim,
            valid,
            u,
            v,
            s.normal,
        )
        store_row(points.offset, 0, i, place.offset * per_rounding + unlike_rounding)
        store_row(points.uv, 0, i, s.u)
        store_row(points.uv, 1, i, s.v)
        store_row(points.shape, 0, i, shape)
        store_row(points.prim, 0, i, prim)
        store_row(points.t, 0, i, t)
        store3(points.throughput, i, gather3(rays.throughput, ray, valid))
        store_row(points.pdf, 0, i, gather_row(rays.pdf, 0, ray, valid))
        store_row(points.eta, 0, i, gather_row(rays.eta, 0, ray, valid))
        store_row(points.slot, 0, i, gather_row(rays.slot, 0, ray, valid))
        _store_previous(points.previous, i, rays, ray, valid)
    as_mitsuba_rounds(scene.replayed, scene, rays, hits, order, count, points)
