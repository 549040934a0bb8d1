"""Stage 3, the surface at a hit: position, normals, uv, and how uncertain the position is.

What a point on a sphere is, the sphere knows (`kinds.shapes`). Here its kernels are called
for those hits of a batch that are on spheres, and so on for each kind of shape. Then all
points are put in their place in the world, beside the state of their paths.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.lanes.memory import gather_row, load_row, store_row, store_where
from renderer.kernels.lanes.vectors import gather3, load3, select3, store3, store3_where
from renderer.kernels.records.kernel_scene import AFTER_SURFACE_POINTS, LOCATE, RECORD
from renderer.kinds.shapes.surface import magnitude, surface_point, tangent_at
from renderer.stages.placement import (
    Place,
    in_world,
    instance_of,
    object_hit_point,
    tangent_in_world,
)


@method_kernel
def locate(
    surfaces, settings, primitives, shapes, placements, rays, hits, order, count, points
):
    """Fill in what a kind of shape knows of the hits `order[:count]` that are on it."""
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        ray = load_row(order, 0, i)
        prim = gather_row(hits.prim, 0, ray, valid)
        mine = valid & (prim >= surfaces.first) & (prim < surfaces.end)
        if mask_bits(mine) == 0:
            continue
        t = gather_row(hits.t, 0, ray, mine)
        u = gather_row(hits.u, 0, ray, mine)
        v = gather_row(hits.v, 0, ray, mine)
        instance = instance_of(placements, hits.instance, ray, mine)
        origin, direction = (
            gather3(rays.origin, ray, mine),
            gather3(rays.direction, ray, mine),
        )
        hit_point = object_hit_point(placements, instance, origin, direction, t)
        index = prim - surfaces.first
        s = surface_point(surfaces, index, mine, u, v, hit_point, settings.with_uv)

        shape = gather_row(primitives.shape, 0, prim, mine)
        normal = s.normal * gather_row(shapes.orientation, 0, shape, mine)
        store3_where(points.position, i, s.position, mine)
        store3_where(points.normal, i, normal, mine)
        shading_normal = select3(s.smooth, s.shading_normal, normal)
        store3_where(points.shading_normal, i, shading_normal, mine)
        store_where(points.offset, 0, i, s.offset, mine)
        store_where(points.uv, 0, i, s.u, mine)
        store_where(points.uv, 1, i, s.v, mine)
        if settings.with_tangents != 0:
            tangent = tangent_at(surfaces, index, mine, u, v, s.normal)
            store3_where(points.tangent, i, tangent, mine)


@kernel
def _place(placements, settings, hits, order, count, points):
    """Put points on instances in their place; say how far off new rays start."""
    per_rounding = np.float32(settings.rounding_offset)
    fixed = np.float32(settings.fixed_offset)
    for i in range(0, count, 16):
        place = Place(
            load3(points.position, i),
            load3(points.normal, i),
            load3(points.shading_normal, i),
            load_row(points.offset, 0, i),
        )
        if placements.group.size != 0:
            ray, valid = load_row(order, 0, i), first_lanes(count - i)
            instance = instance_of(placements, hits.instance, ray, valid)
            place = in_world(placements, instance, place)
            store3(points.position, i, place.position)
            store3(points.normal, i, place.normal)
            store3(points.shading_normal, i, place.shading_normal)
            if settings.with_tangents != 0:
                tangent = load3(points.tangent, i)
                tangent = tangent_in_world(placements, instance, tangent)
                store3(points.tangent, i, tangent)
        unlike_rounding = (1.0 + magnitude(place.position)) * fixed
        store_row(points.offset, 0, i, place.offset * per_rounding + unlike_rounding)


@kernel
def _take_over(shape_of, rays, hits, order, count, points):
    """Copy the state of the paths from their rays."""
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        ray = load_row(order, 0, i)
        prim = gather_row(hits.prim, 0, ray, valid)
        store_row(points.prim, 0, i, prim)
        store_row(points.shape, 0, i, gather_row(shape_of, 0, prim, valid))
        store_row(points.t, 0, i, gather_row(hits.t, 0, ray, valid))
        store3(points.wo, i, -gather3(rays.direction, ray, valid))
        store3(points.throughput, i, gather3(rays.throughput, ray, valid))
        store_row(points.pdf, 0, i, gather_row(rays.pdf, 0, ray, valid))
        store_row(points.eta, 0, i, gather_row(rays.eta, 0, ray, valid))
        store_row(points.slot, 0, i, gather_row(rays.slot, 0, ray, valid))


@kernel
def surface_points(scene, rays, hits, order, count, points):
    """Fill `points` with the hits `order[:count]` and the state of their paths."""
    kinds, after = scene.surfaces, scene.hooks
    placements, settings = scene.placements, scene.settings
    for k in range(kinds.shape[0]):
        call(
            kinds[k, LOCATE],
            kinds[k, RECORD],
            (
                settings,
                scene.primitives,
                scene.shapes,
                placements,
                rays,
                hits,
                order,
                count,
                points,
            ),
        )
    _place(placements, settings, hits, order, count, points)
    _take_over(scene.primitives.shape, rays, hits, order, count, points)
    if after[AFTER_SURFACE_POINTS, 1] != 0:
        call(
            after[AFTER_SURFACE_POINTS, 1],
            after[AFTER_SURFACE_POINTS, RECORD],
            (placements, rays, hits, order, count, points),
        )
