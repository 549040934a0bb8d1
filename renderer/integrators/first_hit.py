"""What the first hit alone can tell: depth, and arbitrary output variables (AOVs)."""

from __future__ import annotations

from renderer.bsdfs.diffuse import diffuse_albedo
from renderer.jit import kernel
from renderer.kernel_scene import ANY, DIFFUSE
from renderer.lanes.functions import first_lanes, lane, select, splat_f32, splat_i32, to_f32
from renderer.lanes.memory import gather_row, load_row
from renderer.stages.camera_rays import camera_rays
from renderer.stages.intersect import collect, intersect, seen_by_camera
from renderer.stages.shading_frame import facing
from renderer.stages.surface import surface_points
from renderer.vectors import load3, select3, vec3

# channels of `work.radiance` in this integrator, all computed together
DEPTH = 0
POSITION = 1
UV = 4
GEO_NORMAL = 6
SH_NORMAL = 9
PRIM_INDEX = 12
SHAPE_INDEX = 13  # counted from 1; 0 is a miss
ALBEDO = 14
CHANNELS = 17


@kernel
def _store(radiance, channel, slot, valid, value):
    """Write one channel of 16 surface points to their pixels."""
    for j in range(16):
        if lane(valid, j) != 0.0:
            radiance[channel, lane(slot, j)] = lane(value, j)


@kernel
def _store3(radiance, channel, slot, valid, value):
    _store(radiance, channel, slot, valid, value.x)
    _store(radiance, channel + 1, slot, valid, value.y)
    _store(radiance, channel + 2, slot, valid, value.z)


@kernel
def _albedo(diffuse, scene, points, i, valid):
    """Return k_d; mirrors and glass have none, a black back shows that of the front."""
    zero = splat_f32(0.0)
    black = vec3(zero, zero, zero)
    if diffuse is None:
        return black
    face = facing(scene.shapes, scene.bsdfs.kind, points, i, valid, DIFFUSE)
    shape = load_row(points.shape, 0, i)
    front = gather_row(scene.shapes.front, 0, shape, valid)
    bsdf = select(face.bsdf >= 0, face.bsdf, front)
    lambert = valid & (gather_row(scene.bsdfs.kind, 0, bsdf, valid) == DIFFUSE)
    u = load_row(points.uv, 0, i)
    v = load_row(points.uv, 1, i)
    return select3(lambert, diffuse_albedo(diffuse, bsdf, u, v, lambert), black)


@kernel
def _second_half(rectangles, prim, mask, points, i, face):
    """Return the face, 1 for the far half of a rectangle: Mitsuba's is two triangles."""
    if rectangles is None:
        return face
    mine = mask & (prim >= rectangles.first) & (prim < rectangles.end)
    beyond = load_row(points.uv, 0, i) + load_row(points.uv, 1, i) > 1.0
    return select(mine & beyond, splat_i32(1), face)


@kernel
def _shape_number(instances, hits, order, i, numbers, shape, mask):
    """Return the place in the file, from 1, of shapes or of the instances around them."""
    number = gather_row(numbers, 0, shape, mask)
    if instances is None:
        return number
    instance = gather_row(hits.instance, 0, load_row(order, 0, i), mask)
    copied = mask & (instance >= 0)
    whole = gather_row(instances.placements.number, 0, instance, copied)
    return select(copied, whole, number)


@kernel
def trace_first_hits(scene, tile, sample, work):
    """Write all AOVs of one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, points, radiance = work.rays, work.hits, work.points, work.radiance
    count = camera_rays(
        scene.camera, scene.sampler, scene.replayed, tile, sample, rays, hits
    )
    seen = seen_by_camera(scene.camera_accelerators, scene.accelerators)
    intersect(seen, rays, hits, 0, count, True, None)
    found = collect(scene.stages, hits, 0, count, ANY, work.order, 0)
    surface_points(scene, rays, hits, work.order, found, points)
    for i in range(0, found, 16):
        mask = first_lanes(found - i)
        valid = select(mask, splat_f32(1.0), splat_f32(0.0))
        slot = load_row(points.slot, 0, i)
        shape = load_row(points.shape, 0, i)
        prim = load_row(points.prim, 0, i)
        face = gather_row(scene.face, 0, prim, mask)
        face = _second_half(scene.surfaces.rectangles, prim, mask, points, i, face)
        _store(radiance, DEPTH, slot, valid, load_row(points.t, 0, i))
        _store3(radiance, POSITION, slot, valid, load3(points.position, i))
        _store(radiance, UV, slot, valid, load_row(points.uv, 0, i))
        _store(radiance, UV + 1, slot, valid, load_row(points.uv, 1, i))
        _store3(radiance, GEO_NORMAL, slot, valid, load3(points.normal, i))
        _store3(radiance, SH_NORMAL, slot, valid, load3(points.shading_normal, i))
        _store(radiance, PRIM_INDEX, slot, valid, to_f32(face))
        number = _shape_number(
            scene.accelerators.instances,
            hits,
            work.order,
            i,
            scene.shapes.number,
            shape,
            mask,
        )
        _store(radiance, SHAPE_INDEX, slot, valid, to_f32(number))
        albedo = _albedo(scene.bsdfs.diffuse, scene, points, i, mask)
        _store3(radiance, ALBEDO, slot, valid, albedo)
