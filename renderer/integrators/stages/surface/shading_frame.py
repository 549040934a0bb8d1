"""The BSDF on the visible side of a surface point, and its local frame."""

from __future__ import annotations

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.columns import gather_columns
from renderer.kernels.lanes.functions import select
from renderer.kernels.lanes.memory import gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import dot, load3, select3
from renderer.plugins.sampling.arithmetic import Frame, tangents_of


@kernel
def show_bsdf(shapes, kind_of, kind, points, i, valid):
    """Store the visible BSDFs of points i to i + 15 that are of one kind; return a mask."""
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
        # 0 elsewhere: a parameter of another kind of BSDF may be an index
        store_row(points.parameters, row, i, select(mask, a, 0.0))
        store_row(points.parameters, row + 1, i, select(mask, b, 0.0))
        store_row(points.parameters, row + 2, i, select(mask, c, 0.0))
        store_row(points.parameters, row + 3, i, select(mask, d, 0.0))


@kernel
def frame_at(bsdf, points, i):
    """Return the local frames of points i to i + 15 for one kind of BSDF.

    If the kind reflects only, z is turned to the side that is seen.
    """
    normal = load3(points.shading_normal, i)
    s, t = tangents_of(bsdf.arithmetic, points, i, normal)
    if bsdf.both_sides is None:  # known when it is compiled
        front = dot(load3(points.wo, i), normal) > 0.0
        return Frame(s, t, select3(front, normal, -normal))
    return Frame(s, t, normal)


@kernel
def leave_surface(points, i, direction):
    """Return the origin of a ray that leaves points i to i + 15 in a direction."""
    normal = load3(points.normal, i)
    offset = load_row(points.offset, 0, i)
    side = select(dot(direction, normal) < 0.0, -offset, offset)
    return load3(points.position, i) + normal * side
