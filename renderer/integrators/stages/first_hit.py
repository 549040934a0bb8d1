"""Quantities of the first hit: depth, and arbitrary output variables (AOVs)."""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.intersect import intersect
from renderer.integrators.stages.materials import look_up_textures
from renderer.integrators.stages.surface import (
    append_hits,
    differentiate,
    frame_at,
    load_constants,
    show_bsdf,
    surface_points,
)
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane,
    mask_bits,
    select,
    splat_f32,
    splat_i32,
    to_f32,
)
from renderer.kernels.lanes.memory import gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import dot, load3
from renderer.kernels.records.kernel_scene import (
    ANY,
    HALVES,
    RECORD,
    SHOW_ALBEDO,
    SHOW_NORMAL,
)
from renderer.plugins.bsdfs.kind import albedo_of, normal_of
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.sampling.numbers_and_warps import to_local, to_world

# channels of `work.radiance` for `aov` and `depth`, all computed together
DEPTH = 0
POSITION = 1
UV = 4
GEO_NORMAL = 6
SH_NORMAL = 9
PRIM_INDEX = 12
SHAPE_INDEX = 13  # counted from 1; 0 for a miss
ALBEDO = 14
CHANNELS = 17


@kernel
def _store(radiance, channel, slot, valid, value):
    """Write one channel of 16 surface points to their samples' slots."""
    for j in range(16):
        if lane(valid, j) != 0.0:
            radiance[channel, lane(slot, j)] = lane(value, j)


@kernel
def _store3(radiance, channel, slot, valid, value):
    _store(radiance, channel, slot, valid, value.x)
    _store(radiance, channel + 1, slot, valid, value.y)
    _store(radiance, channel + 2, slot, valid, value.z)


@kernel
def _show_front(shapes, kind_of, kind, points, i, valid):
    """Store the visible-side BSDFs of one kind at 16 points; return their mask.

    A black back side uses the BSDF of the front, and so its albedo.
    """
    seen_in_front = dot(load3(points.wo, i), load3(points.shading_normal, i)) > 0.0
    shape = load_row(points.shape, 0, i)
    front = gather_row(shapes.front, 0, shape, valid)
    shown = select(seen_in_front, front, gather_row(shapes.back, 0, shape, valid))
    bsdf = select(shown >= 0, shown, front)
    there = valid & (bsdf >= 0)
    mine = there & (gather_row(kind_of, 0, bsdf, there) == kind)
    store_row(points.bsdf, 0, i, select(mine, bsdf, -1))
    return mine


@method_kernel
def show_albedo(bsdf, points, count, radiance):
    """Write the albedo of the points with BSDFs of one kind."""
    for i in range(0, count, 16):
        mine = first_lanes(count - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        wo = to_local(frame_at(bsdf, points, i), load3(points.wo, i))
        color = albedo_of(parameters_at(bsdf.form, points, i), wo)
        valid = select(mine, splat_f32(1.0), splat_f32(0.0))
        _store3(radiance, ALBEDO, load_row(points.slot, 0, i), valid, color)


@method_kernel
def show_normal(bsdf, points, count, radiance):
    """Write the perturbed shading normal of the points with normal or bump maps."""
    for i in range(0, count, 16):
        mine = first_lanes(count - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame = frame_at(bsdf, points, i)
        wo = to_local(frame, load3(points.wo, i))
        turned = normal_of(parameters_at(bsdf.form, points, i), wo)
        normal = to_world(bsdf.arithmetic, frame, turned)
        valid = select(mine, splat_f32(1.0), splat_f32(0.0))
        _store3(radiance, SH_NORMAL, load_row(points.slot, 0, i), valid, normal)


@kernel
def _show_bsdfs(scene, hits, order, points, count, radiance):
    """Write the albedo k_d of all points, and the shading normals that BSDFs perturb.

    Delta BSDFs have no k_d and stay black. A black back side stays black too if the
    albedo of its front depends on the direction of view.
    """
    bsdfs = scene.bsdfs
    for kind in range(bsdfs.methods.shape[0]):
        show = bsdfs.methods[kind, SHOW_ALBEDO]
        if bsdfs.methods[kind, RECORD] == 0:
            continue
        for i in range(0, count, 16):
            valid = first_lanes(count - i)
            if show != 0:
                mine = _show_front(scene.shapes, bsdfs.kind, kind, points, i, valid)
            else:
                mine = show_bsdf(scene.shapes, bsdfs.kind, kind, points, i, valid)
            load_constants(bsdfs, kind, points, i, mine)
        look_up_textures(bsdfs, kind, points, np.int64(0), count)
        differentiate(scene, hits, order, kind, points, np.int64(0), count)
        for method in range(SHOW_ALBEDO, SHOW_NORMAL + 1):
            if bsdfs.methods[kind, method] != 0:
                call(
                    bsdfs.methods[kind, method],
                    bsdfs.methods[kind, RECORD],
                    (points, count, radiance),
                )


@kernel
def _shape_number(placements, hits, order, i, numbers, shape, mask):
    """Return the index in the file, from 1, of shapes or of the instances around them."""
    number = gather_row(numbers, 0, shape, mask)
    if placements.group.size == 0:
        return number
    instance = gather_row(hits.instance, 0, load_row(order, 0, i), mask)
    copied = mask & (instance >= 0)
    whole = gather_row(placements.number, 0, instance, copied)
    return select(copied, whole, number)


@method_kernel
def trace_first_hits(scene, tile, sample, work):
    """Write all AOVs of the samples of a tile's square to `work.radiance`."""
    rays, hits, points, radiance = work.rays, work.hits, work.points, work.radiance
    count = camera_rays(scene, tile, sample, work, np.int64(0))
    intersect(scene.camera_groups, rays, hits, np.int64(0), count, True, None)
    stage, start, order = np.int64(ANY), np.int64(0), work.order
    found = append_hits(scene, rays, hits, start, count, stage, order, points, start)
    surface_points(scene, rays, hits, order, found, points)
    for i in range(0, found, 16):
        mask = first_lanes(found - i)
        valid = select(mask, splat_f32(1.0), splat_f32(0.0))
        slot = load_row(points.slot, 0, i)
        shape = load_row(points.shape, 0, i)
        prim = load_row(points.prim, 0, i)
        # Mitsuba splits its rectangle into two triangles; the far half is face 1
        beyond = load_row(points.uv, 0, i) + load_row(points.uv, 1, i) > 1.0
        face = gather_row(scene.primitives.face, 0, prim, mask)
        face = select(face == HALVES, select(beyond, splat_i32(1), splat_i32(0)), face)
        _store(radiance, DEPTH, slot, valid, load_row(points.t, 0, i))
        _store3(radiance, POSITION, slot, valid, load3(points.position, i))
        _store(radiance, UV, slot, valid, load_row(points.uv, 0, i))
        _store(radiance, UV + 1, slot, valid, load_row(points.uv, 1, i))
        _store3(radiance, GEO_NORMAL, slot, valid, load3(points.normal, i))
        _store3(radiance, SH_NORMAL, slot, valid, load3(points.shading_normal, i))
        _store(radiance, PRIM_INDEX, slot, valid, to_f32(face))
        number = _shape_number(
            scene.placements, hits, work.order, i, scene.shapes.number, shape, mask
        )
        _store(radiance, SHAPE_INDEX, slot, valid, to_f32(number))
    _show_bsdfs(scene, hits, work.order, points, found, radiance)
