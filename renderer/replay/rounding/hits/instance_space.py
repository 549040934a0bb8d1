"""Into the space of an instance and back, as Embree and Mitsuba round it.

Embree finds t and (u, v) with its own ray in the object's space; Mitsuba goes there by
another inverse, and follows its ray to the t of Embree's. Both agreed in all bits with
Mitsuba 3.9.1. `matrices` are those of `instance_matrices`; `instance` is
-1 outside of any.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import affine_at
from renderer.kernels.lanes.vectors import vec3
from renderer.replay.rounding.arithmetic.rounded_once import (
    fused_affine,
    fused_sum,
    fused_times,
    unit,
)
from renderer.replay.rounding.hits.flat_hits import column3, column9


class ObjectRay(NamedTuple):
    """A ray in the space of the object that it hits, as scalars."""

    origin: Any
    direction: Any


@kernel
def embree_ray(matrices, instance, origin, direction):
    """Return the ray with which Embree intersects."""
    if instance < 0:
        return ObjectRay(origin, direction)
    x, y, z = column9(matrices, 0, instance)
    at = column3(matrices, 9, instance)
    o = fused_sum(y, origin.y, fused_sum(z, origin.z, at))
    d = fused_sum(y, direction.y, z * direction.z)
    return ObjectRay(fused_sum(x, origin.x, o), fused_sum(x, direction.x, d))


@kernel
def mitsuba_ray(matrices, instance, origin, direction):
    """Return the ray that Mitsuba follows to the t that Embree found."""
    if instance < 0:
        return ObjectRay(origin, direction)
    x, y, z = column9(matrices, 12, instance)
    at = column3(matrices, 21, instance)
    o = fused_sum(z, origin.z, fused_sum(y, origin.y, fused_sum(x, origin.x, at)))
    d = fused_sum(z, direction.z, fused_sum(y, direction.y, x * direction.x))
    return ObjectRay(o, d)


@kernel
def placed_point(placements, instance, p):
    """Return an object's point in the world."""
    if instance < 0:
        return p
    m = affine_at(placements.to_world, instance)
    return vec3(
        fused_affine(m.x, m.at.x, p),
        fused_affine(m.y, m.at.y, p),
        fused_affine(m.z, m.at.z, p),
    )


@kernel
def placed_vector(placements, instance, a):
    """Return an object's vector in the world."""
    if instance < 0:
        return a
    m = affine_at(placements.to_world, instance)
    return fused_times(m.x, m.y, m.z, a)


@kernel
def placed_normal(matrices, instance, n):
    """Return an object's unit normal in the world, unit."""
    if instance < 0:
        return n
    x, y, z = column9(matrices, 12, instance)
    return unit(fused_times(x, y, z, n))
