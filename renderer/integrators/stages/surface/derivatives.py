"""Stage 4, bumps: dp/du and dp/dv of the points whose BSDFs use them."""

from __future__ import annotations

from renderer.integrators.stages.surface.placement import instance_of, tangent_in_world
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.affine import affine_of, times
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.lanes.memory import load_row, store_where
from renderer.kernels.lanes.vectors import load3, select3
from renderer.kernels.records.kernel_scene import DERIVE, RECORD
from renderer.plugins.shapes.uv.uv_derivatives import uv_derivatives


@method_kernel
def derive(shapes, placements, hits, order, points, row, start, stop):
    """Store both derivatives of points start .. stop - 1 in six rows, if on such shapes."""
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
    """Find both derivatives for the points of one kind of BSDF, if it uses them."""
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
