"""Stage 3 on instances: a surface point of the object goes to its place in the world.

Points by the instance's matrix A and translation a, normals by the inverse transpose of A.
A mirroring A turns no normal around, as in Mitsuba.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import (
    absolute,
    absolute_times,
    affine_of,
    times,
    transposed_times,
)
from renderer.kernels.lanes.functions import mask_bits, select, splat_i32
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import dot, length, normalize, select3
from renderer.plugins.shapes.surface import ROUNDING, magnitude


class Place(NamedTuple):
    """The parts of a surface point that an instance transforms, in 16 lanes."""

    position: Any
    normal: Any  # geometric, unit
    shading_normal: Any  # unit
    offset: Any  # rounding error of the position


@kernel
def instance_of(placements, numbers, ray, valid):
    """Return the instance ids of rays' hits, -1 for hits outside of instances."""
    if placements.group.size == 0:
        return splat_i32(-1)
    return select(valid, gather_row(numbers, 0, ray, valid), -1)


@kernel
def object_hit_point(placements, instance, origin, direction, t):
    """Return p + t d, in the object's space where there is an instance."""
    if placements.group.size == 0:
        return origin + direction * t
    inside = instance >= 0
    m = affine_of(placements.to_object, instance, inside)
    o = select3(inside, times(m, origin - m.at), origin)
    d = select3(inside, times(m, direction), direction)
    return o + d * t


@kernel
def in_world(placements, instance, place):
    """Return an object's surface point in the world.

    How far off a new ray must start: along the object's normal n, a step of 1 in the world
    is a step of |A^-T n|. So what is uncertain along n in the object's space, its own
    rounding and that of the next ray's way in, |n| . |A^-1| |x - a|, is divided by this;
    the way out, x = A y + a, adds |A| |y| + |a| in the world. In units of the last place:
    each of these is computed in at most 8 roundings, and new rays keep 64 away.
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
