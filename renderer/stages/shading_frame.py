"""Which BSDF a surface point shows to the side that it is seen from."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.jit import kernel
from renderer.lanes.functions import select
from renderer.lanes.memory import gather_row, load_row
from renderer.replay.directions import frame_as_mitsuba
from renderer.vectors import dot, load3, orthonormal_basis, select3


class Facing(NamedTuple):
    """16 surface points as one kind of BSDF sees them."""

    mine: Any  # mask: the BSDF of the visible side is of the kind asked for
    bsdf: Any  # BSDF id
    front: Any  # mask: seen from the side of the normal


@kernel
def facing(shapes, kinds, points, i, valid, kind):
    """Return the `Facing` of points i to i + 15 for a kind of BSDF; `kinds` by BSDF id."""
    wo = load3(points.wo, i)
    front = dot(wo, load3(points.shading_normal, i)) > 0.0
    shape = load_row(points.shape, 0, i)
    ahead = gather_row(shapes.front, 0, shape, valid)
    behind = gather_row(shapes.back, 0, shape, valid)
    bsdf = select(front, ahead, behind)
    shown = valid & (bsdf >= 0)
    mine = shown & (gather_row(kinds, 0, bsdf, shown) == kind)
    return Facing(mine, bsdf, front)


@kernel
def tangents_of(tangent, i, normal):
    """Return two unit vectors across the shading normals of points i to i + 15.

    In a replay the first is Mitsuba's, dp/du without its part along the normal. They
    belong to the surface and not to the side that is seen: from behind, Mitsuba turns z
    around and leaves x and y, which makes the frame left-handed.
    """
    s, t = orthonormal_basis(normal)
    if tangent is None:
        return s, t
    along_u = load3(tangent, i)
    across, beside = frame_as_mitsuba(along_u, normal)
    nowhere = (along_u.x == 0.0) & (along_u.y == 0.0) & (along_u.z == 0.0)
    return select3(nowhere, s, across), select3(nowhere, t, beside)


@kernel
def leave_surface(points, i, direction):
    """Return the origin of a ray that leaves points i to i + 15 in a direction."""
    normal = load3(points.normal, i)
    offset = load_row(points.offset, 0, i)
    side = select(dot(direction, normal) < 0.0, -offset, offset)
    return load3(points.position, i) + normal * side
