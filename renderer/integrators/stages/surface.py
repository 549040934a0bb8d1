"""Surface points of hits: position, normals, texture coordinates, shading frame."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
    select,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_columns,
    gather_row,
    load_row,
    store_row,
    store_where,
)
from renderer.kernels.lanes.vectors import (
    absolute,
    absolute_times,
    affine_of,
    append3,
    dot,
    length,
    load3,
    normalize,
    select3,
    store3,
    store3_where,
    times,
    transposed_times,
    vec3,
)
from renderer.kernels.records.kernel_scene import (
    AFTER_SURFACE_POINTS,
    DERIVE,
    LOCATE,
    RECORD,
)
from renderer.plugins.sampling.numbers_and_warps import (
    Frame,
    tangents_of,
    to_local,
    to_world,
)
from renderer.plugins.shapes.surface import ROUNDING, magnitude, surface_point, tangent_at
from renderer.plugins.shapes.uv import uv_derivatives

# ------------------------------------------------------------------------ shading frame
# The BSDF on the visible side of a surface point, and its local frame.


@kernel
def show_bsdf(shapes, kind_of, kind, points, i, valid):
    """Store the visible-side BSDFs of one kind at points i to i + 15; return their mask."""
    front = dot(load3(points.wo, i), load3(points.shading_normal, i)) > 0.0
    shape = load_row(points.shape, 0, i)
    ahead = gather_row(shapes.front, 0, shape, valid)
    behind = gather_row(shapes.back, 0, shape, valid)
    bsdf = select(front, ahead, behind)
    shown = valid & (bsdf >= 0)
    mine = shown & (gather_row(kind_of, 0, bsdf, shown) == kind)
    store_row(points.bsdf, 0, i, select(mine, bsdf, -1))
    return mine


@kernel
def load_constants(bsdfs, kind, points, i, mask):
    """Load the constant parameters of the BSDFs of points i to i + 15."""
    bsdf = load_row(points.bsdf, 0, i)
    for row in range(0, bsdfs.rows[kind], 4):
        a, b, c, d = gather_columns(bsdfs.values, row, bsdf, mask)
        # 0 in other lanes, where the parameter may be an index of another kind of BSDF
        store_row(points.parameters, row, i, select(mask, a, 0.0))
        store_row(points.parameters, row + 1, i, select(mask, b, 0.0))
        store_row(points.parameters, row + 2, i, select(mask, c, 0.0))
        store_row(points.parameters, row + 3, i, select(mask, d, 0.0))


@kernel
def frame_at(bsdf, points, i):
    """Return the local frames of points i to i + 15 for one kind of BSDF.

    If the kind only reflects, z points to the visible side.
    """
    normal = load3(points.shading_normal, i)
    s, t = tangents_of(bsdf.arithmetic, points, i, normal)
    if bsdf.both_sides is None:  # compile-time constant
        front = dot(load3(points.wo, i), normal) > 0.0
        return Frame(s, t, select3(front, normal, -normal))
    return Frame(s, t, normal)


@kernel
def local_wo(bsdf, points, i):
    """Return the local frames of points i to i + 15, and wo in them.

    If all directions lie in the plane of wo and the normal (`BsdfKind.in_plane`), the frame
    has one tangent. That tangent is not normalised: the component of wo along it is 1.
    """
    wo = load3(points.wo, i)
    if bsdf.in_plane is None:  # compile-time constant
        frame = frame_at(bsdf, points, i)
        return frame, to_local(frame, wo)
    normal = load3(points.shading_normal, i)
    cosine = dot(wo, normal)
    along = wo - normal * cosine
    if bsdf.both_sides is None:
        normal = select3(cosine > 0.0, normal, -normal)
        cosine = fabs(cosine)
    one = splat_f32(1.0)
    return Frame(along, along, normal), vec3(one, splat_f32(0.0), cosine)


@kernel
def world_direction(bsdf, frame, local):
    """Return the world direction of a direction in a frame of `local_wo`."""
    if bsdf.in_plane is None:
        return to_world(bsdf.arithmetic, frame, local)
    return frame.s * local.x + frame.n * local.z


@kernel
def leave_surface(points, i, direction):
    """Return the offset origin of a ray that leaves points i to i + 15 in a direction."""
    normal = load3(points.normal, i)
    offset = load_row(points.offset, 0, i)
    side = select(dot(direction, normal) < 0.0, -offset, offset)
    return load3(points.position, i) + normal * side


# -------------------------------------------------------------------------- derivatives
# Stage 4, bump maps: dp/du and dp/dv at the points whose BSDFs need them.


@method_kernel
def derive(shapes, placements, hits, order, points, row, start, stop):
    """Store dp/du and dp/dv of points start .. stop - 1 that are on one kind of shape."""
    for i in range(start, stop, 16):
        valid = first_lanes(stop - i)
        prim = load_row(points.prim, 0, i)
        mine = valid & (prim >= shapes.first) & (prim < shapes.end)
        if mask_bits(mine) == 0:
            continue
        instance = instance_of(placements, hits.instance, load_row(order, 0, i), mine)
        position = load3(points.position, i)
        if placements.group.size != 0:
            copied = mine & (instance >= 0)
            back = affine_of(placements.to_object, instance, copied)
            position = select3(copied, times(back, position - back.at), position)
        du, dv = uv_derivatives(shapes, prim - shapes.first, mine, position)
        if placements.group.size != 0:
            du = tangent_in_world(placements, instance, du)
            dv = tangent_in_world(placements, instance, dv)
        store_where(points.parameters, row, i, du.x, mine)
        store_where(points.parameters, row + 1, i, du.y, mine)
        store_where(points.parameters, row + 2, i, du.z, mine)
        store_where(points.parameters, row + 3, i, dv.x, mine)
        store_where(points.parameters, row + 4, i, dv.y, mine)
        store_where(points.parameters, row + 5, i, dv.z, mine)


@kernel
def differentiate(scene, hits, order, kind, points, start, stop):
    """Compute dp/du and dp/dv for the points of one kind of BSDF that needs them."""
    bsdfs = scene.bsdfs
    for k in range(bsdfs.derived.shape[0]):
        if bsdfs.derived[k, 0] != kind:
            continue
        for shapes in range(bsdfs.derivatives.shape[0]):
            call(
                bsdfs.derivatives[shapes, DERIVE],
                bsdfs.derivatives[shapes, RECORD],
                (
                    scene.placements,
                    hits,
                    order,
                    points,
                    bsdfs.derived[k, 1],
                    start,
                    stop,
                ),
            )


# ---------------------------------------------------------------------------- placement
# Stage 3 for instances: transform surface points from object space to the world.
#
# Points use the instance's matrix A and translation a, normals the inverse transpose of A.
# As in Mitsuba, a mirroring A does not flip normals.


class Place(NamedTuple):
    """The parts of a surface point that an instance transforms, in 16 lanes."""

    position: Any
    normal: Any  # geometric, unit
    shading_normal: Any  # unit
    offset: Any  # bound of the rounding error of the position along the normal


@kernel
def instance_of(placements, numbers, ray, valid):
    """Return the instance ids of the rays' hits, -1 for hits outside of instances."""
    if placements.group.size == 0:
        return splat_i32(-1)
    return select(valid, gather_row(numbers, 0, ray, valid), -1)


@kernel
def object_hit_point(placements, instance, origin, direction, t):
    """Return p + t d, in object space for hits in an instance."""
    if placements.group.size == 0:
        return origin + direction * t
    inside = instance >= 0
    m = affine_of(placements.to_object, instance, inside)
    o = select3(inside, times(m, origin - m.at), origin)
    d = select3(inside, times(m, direction), direction)
    return o + d * t


@kernel
def in_world(placements, instance, place):
    """Return an object-space surface point in the world.

    The offset of a new ray: a step of 1 along the world's normal is a step of |A^-T n|
    along the object's normal n. So the uncertainty along n in object space is divided by
    |A^-T n|. It is the rounding of the hit, and that of the next ray's transform into the
    object, |n| . |A^-1| |x - a|. The transform to the world, x = A y + a, adds
    |A| |y| + |a|. These are in units of the last place: each takes at most 8 roundings,
    and new rays keep 64 away.
    """
    inside = instance >= 0
    if mask_bits(inside) == 0:
        return place
    out = affine_of(placements.to_world, instance, inside)
    back = affine_of(placements.to_object, instance, inside)
    from_origin = times(out, place.position)
    normal = transposed_times(back, place.normal)
    way_in = dot(absolute(place.normal), absolute_times(back, from_origin)) * ROUNDING
    way_out = magnitude(absolute_times(out, place.position) + absolute(out.at)) * ROUNDING
    offset = (place.offset + way_in) / length(normal) + way_out
    return Place(
        select3(inside, from_origin + out.at, place.position),
        select3(inside, normalize(normal), place.normal),
        select3(
            inside,
            normalize(transposed_times(back, place.shading_normal)),
            place.shading_normal,
        ),
        select(inside, offset, place.offset),
    )


@kernel
def tangent_in_world(placements, instance, tangent):
    """Return dp/du in the world."""
    inside = instance >= 0
    if mask_bits(inside) == 0:
        return tangent
    out = affine_of(placements.to_world, instance, inside)
    return select3(inside, times(out, tangent), tangent)


# ------------------------------------------------------------------------------ surface
# Stage 3, the surface at a hit: position, normals, uv, and the rounding error of position.
#
# Each kind of shape has a kernel that computes its points (`plugins.shapes.surface`). It
# is called here for the hits of a batch on shapes of that kind. Then the points on
# instances are transformed to the world.


@kernel
def append_hits(scene, rays, hits, first, count, stage, order, points, end):
    """Append the hits of `count` rays that need `stage` to `points`; return the new end.

    The points inherit the state of their paths. Until `locate` replaces them, position is
    the ray's origin and uv are the primitive's coordinates. `order` holds the ray index of
    each point. Compacting here takes a third of the time of gathering by `order`.
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
    """Compute the surface at those of `count` points that are on one kind of shape."""
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
    """Transform points on instances to the world; set the ray offsets of all points."""
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


class Previous(NamedTuple):
    """The record of `keep_previous_points`; it has no fields."""


@method_kernel
def keep_previous_points(_, placements, rays, hits, order, count, points):
    """Copy the exact previous position of each path to its point."""
    for i in range(count):
        for c in range(3):
            points.previous[c, i] = rays.previous[c, order[i]]


@kernel
def surface_points(scene, rays, hits, order, count, points):
    """Compute the surfaces of the first `count` points that `append_hits` wrote."""
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
