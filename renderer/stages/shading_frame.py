"""Which BSDF a surface point shows to the side that it is seen from."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.jit import kernel
from renderer.lanes.functions import select
from renderer.lanes.memory import gather_row, load_row
from renderer.vectors import dot, load3


class Facing(NamedTuple):
    """16 surface points as one kind of BSDF sees them."""

    mine: Any  # mask: the BSDF of the visible side is of the kind asked for
    bsdf: Any  # BSDF id
    front: Any  # mask: seen from the side of the normal


@kernel
def facing(scene, points, i, valid, kind):
    """Return the `Facing` of points i to i + 15 for a kind of BSDF."""
    wo = load3(points.wo, i)
    front = dot(wo, load3(points.shading_normal, i)) > 0.0
    shape = load_row(points.shape, 0, i)
    ahead = gather_row(scene.shapes.front, 0, shape, valid)
    behind = gather_row(scene.shapes.back, 0, shape, valid)
    bsdf = select(front, ahead, behind)
    shown = valid & (bsdf >= 0)
    mine = shown & (gather_row(scene.bsdfs.kind, 0, bsdf, shown) == kind)
    return Facing(mine, bsdf, front)


@kernel
def leave_surface(points, i, direction):
    """Return the origin of a ray that leaves points i to i + 15 in a direction."""
    normal = load3(points.normal, i)
    offset = load_row(points.offset, 0, i)
    side = select(dot(direction, normal) < 0.0, -offset, offset)
    return load3(points.position, i) + normal * side
