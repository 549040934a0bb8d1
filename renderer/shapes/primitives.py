"""The same three questions for every kind of primitive, resolved by type at compile time.

`primitive_at(group, k)` and `primitives_from(group, k)` fetch one primitive or 16 of a
group, `hit_primitive(group, primitive, origin, direction, t_max)` intersects: all without
a branch at run time, so that an accelerator is written once for all kinds.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from renderer.jit import record_class
from renderer.shapes.blocks import (
    CylinderBlocks,
    DiskBlocks,
    RectangleBlocks,
    SphereBlocks,
    TriangleBlocks,
    cylinder_in,
    patch_in,
    sphere_in,
)
from renderer.shapes.cylinder import Cylinders, cylinder_at, cylinders_from, hit_cylinder
from renderer.shapes.disk import Disks, hit_disk
from renderer.shapes.patch import patch_at, patches_from
from renderer.shapes.rectangle import Rectangles, hit_rectangle
from renderer.shapes.sphere import Spheres, hit_sphere, sphere_at, spheres_from
from renderer.shapes.triangle import Triangles, hit_triangle

_FETCH_ONE = {
    Triangles: patch_at,
    Rectangles: patch_at,
    Disks: patch_at,
    Spheres: sphere_at,
    Cylinders: cylinder_at,
    TriangleBlocks: patch_in,
    RectangleBlocks: patch_in,
    DiskBlocks: patch_in,
    SphereBlocks: sphere_in,
    CylinderBlocks: cylinder_in,
}
_FETCH_SIXTEEN = {
    Triangles: patches_from,
    Rectangles: patches_from,
    Disks: patches_from,
    Spheres: spheres_from,
    Cylinders: cylinders_from,
}
_HIT = {
    Triangles: hit_triangle,
    Rectangles: hit_rectangle,
    Disks: hit_disk,
    Spheres: hit_sphere,
    Cylinders: hit_cylinder,
    TriangleBlocks: hit_triangle,
    RectangleBlocks: hit_rectangle,
    DiskBlocks: hit_disk,
    SphereBlocks: hit_sphere,
    CylinderBlocks: hit_cylinder,
}


def primitive_at(group: Any, k: int) -> Any:
    """Return primitive k of a group as scalars."""
    raise TypeError("inside kernels only")


def primitives_from(group: Any, k: int) -> Any:
    """Return primitives k to k + 15 of a group as lanes."""
    raise TypeError("inside kernels only")


def hit_primitive(
    group: Any, primitive: Any, origin: Any, direction: Any, t_max: Any
) -> Any:
    """Intersect a primitive that came from `group`; return an `Intersection`."""
    raise TypeError("inside kernels only")


@overload(primitive_at)
def _primitive_at(group, k):
    fetch = _FETCH_ONE.get(record_class(group))
    return None if fetch is None else lambda group, k: fetch(group, k)


@overload(primitives_from)
def _primitives_from(group, k):
    fetch = _FETCH_SIXTEEN.get(record_class(group))
    return None if fetch is None else lambda group, k: fetch(group, k)


@overload(hit_primitive)
def _hit_primitive(group, primitive, origin, direction, t_max):
    hit = _HIT.get(record_class(group))
    if hit is None:
        return None
    return lambda group, primitive, origin, direction, t_max: hit(
        primitive, origin, direction, t_max
    )
