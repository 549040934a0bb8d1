"""Stage 3 in a replay: dp/du at the hits, the first axis of Mitsuba's shading frames.

A flip of the normals leaves it alone; only its direction matters.
"""

from __future__ import annotations

from renderer.affine import affine_of, times
from renderer.jit import kernel
from renderer.lanes.functions import mask_bits, select, splat_f32, sqrt
from renderer.vectors import dot, gather3, gather_rows3, select3, store3, vec3


@kernel
def _of_kind(surfaces, prim, mask):
    return mask & (prim >= surfaces.first) & (prim < surfaces.end)


@kernel
def _on_triangles(triangles, prim, mask, tangent):
    if triangles is None:
        return tangent
    mine = _of_kind(triangles, prim, mask)
    along_u = gather3(triangles.tangents, prim - triangles.first, mine)
    return select3(mine, along_u, tangent)


@kernel
def _on_rectangles(rectangles, prim, mask, tangent):
    if rectangles is None:
        return tangent
    mine = _of_kind(rectangles, prim, mask)
    along_u = gather3(rectangles.edge1, prim - rectangles.first, mine)
    return select3(mine, along_u, tangent)


@kernel
def _on_disks(disks, prim, mask, x, y, tangent):
    """Take the way outwards, as u is the distance from the centre; there, along x."""
    if disks is None:
        return tangent
    mine = _of_kind(disks, prim, mask)
    radius = sqrt(x * x + y * y)
    inverse = 1.0 / select(radius == 0.0, splat_f32(1.0), radius)
    cosine = select(radius == 0.0, splat_f32(1.0), x * inverse)
    edge1 = gather3(disks.edge1, prim - disks.first, mine)
    edge2 = gather3(disks.edge2, prim - disks.first, mine)
    return select3(mine, edge1 * cosine + edge2 * (y * inverse), tangent)


@kernel
def _around_axis(curved, prim, mask, normal, tangent):
    """Take the way around the local z axis, whose angle is u; 0 at a pole."""
    if curved is None:
        return tangent
    mine = _of_kind(curved, prim, mask)
    x_axis = gather_rows3(curved.frame, 0, prim - curved.first, mine)
    y_axis = gather_rows3(curved.frame, 3, prim - curved.first, mine)
    around = y_axis * dot(x_axis, normal) - x_axis * dot(y_axis, normal)
    return select3(mine, around, tangent)


@kernel
def _in_world(instances, instance, tangent):
    if instances is None:
        return tangent
    inside = instance >= 0
    if mask_bits(inside) == 0:
        return tangent
    out = affine_of(instances.placements.to_world, instance, inside)
    return select3(inside, times(out, tangent), tangent)


@kernel
def store_tangents(tangents, i, surfaces, instances, instance, prim, mask, u, v, normal):
    """Store dp/du of 16 hits in columns i to i + 15 of `tangents`, if anybody asks.

    Parameters
    ----------
    u, v
        The primitives' own coordinates of the hits.
    normal
        Unit, in the object's space, away from the axis or the centre.
    """
    if tangents is None:
        return
    zero = splat_f32(0.0)
    tangent = vec3(zero, zero, zero)
    tangent = _on_triangles(surfaces.triangles, prim, mask, tangent)
    tangent = _on_rectangles(surfaces.rectangles, prim, mask, tangent)
    tangent = _on_disks(surfaces.disks, prim, mask, u, v, tangent)
    tangent = _around_axis(surfaces.spheres, prim, mask, normal, tangent)
    tangent = _around_axis(surfaces.cylinders, prim, mask, normal, tangent)
    store3(tangents, i, _in_world(instances, instance, tangent))
