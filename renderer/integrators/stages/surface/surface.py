"""Stage 3, the surface at a hit: position, normals, uv, and how uncertain the position is.

Each kind of shape has a kernel that computes its points (`plugins.shapes.surface`). Here it
is called for those hits of a batch that are on shapes of the kind. Then the points on
instances are transformed to the world.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.surface.placement import (
    Place,
    in_world,
    instance_of,
    object_hit_point,
    tangent_in_world,
)
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    store_row,
    store_where,
)
from renderer.kernels.lanes.vectors import append3, load3, select3, store3, store3_where
from renderer.kernels.records.kernel_scene import AFTER_SURFACE_POINTS, LOCATE, RECORD
from renderer.plugins.shapes.surface import magnitude, surface_point, tangent_at


@kernel
def append_hits(scene, rays, hits, first, count, stage, order, points, end):
    """Append the hits of `count` rays that need `stage` to `points`; return the new end.

    The points get the state of their paths. Until `locate` replaces them, position is the
    ray's origin and uv are the primitive's coordinates. `order` holds the ray of each
    point. Packing the lanes here takes a third of the time of gathering them by `order`.
    """
    stages, shapes = scene.primitives.stages, scene.primitives.shape
    for i in range(first, first + count, 16):
        prim = load_row(hits.prim, 0, i)
        found = (prim >= 0) & first_lanes(first + count - i)
        wanted = (gather_row(stages, 0, prim, found) & stage) != 0
        if mask_bits(wanted) == 0:
            continue
        append_row(order, 0, end, lane_index() + i, wanted)
        append_row(points.prim, 0, end, prim, wanted)
        append_row(points.shape, 0, end, gather_row(shapes, 0, prim, wanted), wanted)
        append_row(points.t, 0, end, load_row(hits.t, 0, i), wanted)
        append_row(points.uv, 0, end, load_row(hits.u, 0, i), wanted)
        append_row(points.uv, 1, end, load_row(hits.v, 0, i), wanted)
        append3(points.position, end, load3(rays.origin, i), wanted)
        append3(points.wo, end, -load3(rays.direction, i), wanted)
        append3(points.throughput, end, load3(rays.throughput, i), wanted)
        append_row(points.pdf, 0, end, load_row(rays.pdf, 0, i), wanted)
        append_row(points.eta, 0, end, load_row(rays.eta, 0, i), wanted)
        append_row(points.slot, 0, end, load_row(rays.slot, 0, i), wanted)
        end += popcount(mask_bits(wanted))
    return end


@method_kernel
def locate(surfaces, settings, shapes, placements, hits, order, count, points):
    """Compute the surface of those of `count` points that are on one kind of shape."""
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        prim = load_row(points.prim, 0, i)
        mine = valid & (prim >= surfaces.first) & (prim < surfaces.end)
        if mask_bits(mine) == 0:
            continue
        t = load_row(points.t, 0, i)
        u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
        origin, direction = load3(points.position, i), -load3(points.wo, i)
        instance = instance_of(placements, hits.instance, load_row(order, 0, i), mine)
        hit_point = object_hit_point(placements, instance, origin, direction, t)
        index = prim - surfaces.first
        s = surface_point(surfaces, index, mine, u, v, hit_point, settings.with_uv)

        shape = load_row(points.shape, 0, i)
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
    """Transform points on instances to the world; set the offset of new rays."""
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
def surface_points(scene, rays, hits, order, count, points):
    """Fill in the surfaces of the first `count` points that `append_hits` gave."""
    kinds, after = scene.surfaces, scene.hooks
    placements, settings = scene.placements, scene.settings
    for k in range(kinds.shape[0]):
        call(
            kinds[k, LOCATE],
            kinds[k, RECORD],
            (settings, scene.shapes, placements, hits, order, count, points),
        )
    _place(placements, settings, hits, order, count, points)
    for k in range(AFTER_SURFACE_POINTS, after.shape[0]):
        call(after[k, 1], after[k, RECORD], (placements, rays, hits, order, count, points))
