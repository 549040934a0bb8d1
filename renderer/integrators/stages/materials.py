"""Stage 4, materials: group the hits by kind of BSDF and look up its parameters."""

from __future__ import annotations

from renderer.integrators.stages.surface import (
    append_hits,
    differentiate,
    load_constants,
    show_bsdf,
    surface_points,
)
from renderer.kernels.jit import call, kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.records.kernel_scene import FIRST_BSDF, RECORD


@kernel
def group_by_bsdf(scene, work, first, count):
    """Fill `work.points`, grouped by kind of BSDF, and `work.ends`, the ends of groups."""
    list_by_bsdf(scene, work, first, count)
    prepare_bsdfs(scene, work)


@kernel
def list_by_bsdf(scene, work, first, count):
    """Fill `work.points` with surface points, without BSDF parameters, and `work.ends`."""
    bsdfs, ends, rays, hits = scene.bsdfs, work.ends, work.rays, work.hits
    order, points = work.order, work.points
    ends[0] = 0
    for kind in range(bsdfs.methods.shape[0]):
        ends[kind + 1] = ends[kind]
        if bsdfs.methods[kind, RECORD] == 0:
            continue  # a kind with no scattering: paths end there
        stage = FIRST_BSDF << kind
        ends[kind + 1] = append_hits(
            scene, rays, hits, first, count, stage, order, points, ends[kind]
        )
    total = ends[bsdfs.methods.shape[0]]
    surface_points(scene, rays, hits, order, total, points)


@kernel
def prepare_bsdfs(scene, work):
    """Load the BSDF parameters of the grouped points."""
    bsdfs, ends, hits = scene.bsdfs, work.ends, work.hits
    order, points = work.order, work.points
    for kind in range(bsdfs.methods.shape[0]):
        start, stop = ends[kind], ends[kind + 1]
        load_parameters(scene.shapes, bsdfs, kind, points, start, stop)
        differentiate(scene, hits, order, kind, points, start, stop)


@kernel
def load_parameters(shapes, bsdfs, kind, points, start, stop):
    """Find the BSDF of each point of a group, and load its parameters."""
    for i in range(start, stop, 16):
        valid = first_lanes(stop - i)
        mine = show_bsdf(shapes, bsdfs.kind, kind, points, i, valid)
        if mask_bits(mine) != 0:
            load_constants(bsdfs, kind, points, i, mine)
    look_up_textures(bsdfs, kind, points, start, stop)


@kernel
def look_up_textures(bsdfs, kind, points, start, stop):
    """Evaluate the textured parameters of the points of a group."""
    for k in range(bsdfs.look_ups.shape[0]):
        if bsdfs.look_ups[k, 0] != kind:
            continue
        texture_kind = bsdfs.look_ups[k, 1]
        row, request = bsdfs.look_ups[k, 2], bsdfs.look_ups[k, 3]
        method = bsdfs.texture_methods
        call(
            method[texture_kind, request],
            method[texture_kind, RECORD],
            (bsdfs, texture_kind, row, points, start, stop),
        )
