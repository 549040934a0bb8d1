"""Stage 3 on instances: a surface point of the object goes to its place in the world.

Points by the instance's matrix A and translation a, normals by the inverse transpose of A.
A mirroring A turns no normal around, as in Mitsuba.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.affine import absolute, absolute_times, affine_of, times, transposed_times
from renderer.jit import kernel
from renderer.lanes.functions import fabs, mask_bits, maximum, select
from renderer.lanes.memory import gather_row
from renderer.vectors import dot, length, normalize, select3

# The position on a primitive is known up to about this fraction of its coordinates.
ROUNDING = np.float32(2.0**-24)


class Place(NamedTuple):
    """What of a surface depends on where it is, in 16 lanes."""

    position: Any
    normal: Any  # geometric, unit
    shading_normal: Any  # unit
    offset: Any  # rounding error of the position


@kernel
def magnitude(a):
    """Return the largest absolute component."""
    return maximum(maximum(fabs(a.x), fabs(a.y)), fabs(a.z))


@kernel
def instance_of(instances, numbers, ray, valid):
    """Return the instance ids of rays' hits; -1, and none where the scene has none."""
    if instances is None:
        return None
    instance = gather_row(numbers, 0, ray, valid)
    return select(valid, instance, -1)


@kernel
def object_hit_point(instances, instance, origin, direction, t):
    """Return p + t d, in the object's space where there is an instance."""
    if instances is None:
        return origin + direction * t
    inside = instance >= 0
    m = affine_of(instances.placements.to_object, instance, inside)
    o = select3(inside, times(m, origin - m.at), origin)
    d = select3(inside, times(m, direction), direction)
    return o + d * t


@kernel
def in_world(instances, instance, place):
    """Return the place in the world of a place on an object.

    How far off a new ray must start: along the object's normal n, a step of 1 in the world
    is a step of |A^-T n|. So what is uncertain along n in the object's space, its own
    rounding and that of the next ray's way in, |n| . |A^-1| |x - a|, is divided by this;
    the way out, x = A y + a, adds |A| |y| + |a| in the world. In units of the last place:
    each of these is computed in at most 8 roundings, and new rays keep 64 away.
    """
    if instances is None:
        return place
    inside = instance >= 0
    if mask_bits(inside) == 0:
        return place
    out = affine_of(instances.placements.to_world, instance, inside)
    back = affine_of(instances.placements.to_object, instance, inside)
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
