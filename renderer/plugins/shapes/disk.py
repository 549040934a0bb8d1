"""Ray against disk (an ellipse after an affine map): the plane, then u^2 + v^2 <= 1."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import any_of, fabs, select, splat_f32, sqrt
from renderer.kernels.lanes.mathematics import sincos
from renderer.kernels.lanes.vectors import cross, length, vec3
from renderer.plugins.sampling.numbers_and_warps import TWO_PI, square_to_disk
from renderer.plugins.shapes import flat
from renderer.plugins.shapes.flat import (
    Patch,
    divided,
    grazing,
    meet_plane,
    meet_plane_in_double,
)
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import Intersection
from renderer.plugins.shapes.surface import (
    SurfacePoint,
    UvPoint,
    flat_light_point,
    flat_point,
    gather_flat,
    nowhere,
    turn,
)
from renderer.scene_file.description import Disk


class Ellipse(Patch):
    """`corner` is the centre; `edge1` and `edge2` are the half axes."""


@kernel
def _doubtful(disk, p, direction):
    around = (fabs(p.u) <= p.scale) & (fabs(p.v) <= p.scale)
    return around & grazing(disk, p, direction)


@kernel
def _within(p, t_max):
    # divide first: u^2 and v^2 times scale^2 would underflow for a tiny disk
    x = divided(p, p.scale > 0.0, t_max)
    return Intersection(x.hit & (x.u * x.u + x.v * x.v <= 1.0), x.t, x.u, x.v)


@kernel
def hit_disk(disk, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max, u and v are the local x and y."""
    p = meet_plane(disk, origin, direction)
    doubtful = _doubtful(disk, p, direction)
    if any_of(doubtful):
        p = meet_plane_in_double(disk, origin, direction, doubtful, p)
    return _within(p, t_max)


# ------------------------------------------------------------------ surface and light


@table_columns("places")
class DiskSurfaces(flat.FlatSurfaces):
    """Disks; `corner` is the centre."""


@kernel
def _point_on_disk(disks, index, mask, u, v, hit_point, with_uv):
    """Return the point; its texture coordinates are (radius, angle / 2 pi)."""
    position, normal, offset = flat_point(disks, index, mask, u, v)
    radius = sqrt(u * u + v * v)
    angle = turn(u, v) if with_uv != 0 else u * 0.0
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, radius, angle)


@kernel
def _tangent_of_disk(disks, index, mask, x, y, normal):
    """Return the radial direction, as u is the radius; the local x axis at the centre."""
    radius = sqrt(x * x + y * y)
    inverse = 1.0 / select(radius == 0.0, splat_f32(1.0), radius)
    cosine = select(radius == 0.0, splat_f32(1.0), x * inverse)
    p = gather_flat(disks, index, mask)
    return p.edge1 * cosine + p.edge2 * (y * inverse)


@kernel
def _sample_disk(disks, kind, light, mask, position, x, y, z):
    """Choose a point, uniformly by area."""
    u, v = square_to_disk(x, y)
    return flat_light_point(disks, kind, light, mask, position, u, v)


@kernel
def _at_uv(disks, chart, light, prim, orientation, u, v, mask):
    index = prim - disks.first
    p = gather_flat(disks, index, mask)
    sine, cosine = sincos(TWO_PI * v)
    position = p.corner + (p.edge1 * cosine + p.edge2 * sine) * u
    per_area = length(cross(p.edge1, p.edge2)) * (TWO_PI * u)
    return UvPoint(position, p.normal * orientation, per_area, mask)


@kernel
def _uv_axes(disks, q, radius):
    none = splat_f32(0.0)
    outwards = vec3(q.x / radius, q.y / radius, none)
    return outwards, vec3(-q.y, q.x, none) * TWO_PI


# ---------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Disk:
    """Read the properties of a `disk`."""
    to_world = properties.transform("to_world")
    flip = properties.boolean("flip_normals", False)
    return Disk(**common, to_world=to_world, flip_normals=flip)


def surfaces(shapes: list[Disk], first: int) -> DiskSurfaces:
    """Return the surfaces of shapes with primitive ids from `first` on."""
    x, y, center = flat.placed_axes(shapes)
    return flat.flat_surfaces(DiskSurfaces, first, center, x, y)


def _corners(s: Any) -> list[NDArray[np.float32]]:
    reach = np.hypot(s.edge1, s.edge2)
    return [s.corner - reach, s.corner + reach]


DISKS = ShapeKind(
    name="disks",
    plugins={"disk": read},
    description=Disk,
    record=DiskSurfaces,
    surfaces=surfaces,
    primitive=Ellipse,
    numbers=flat.numbers,
    intersect=hit_disk,
    surface_point=_point_on_disk,
    tangent=_tangent_of_disk,
    sample=_sample_disk,
    point_at_uv=_at_uv,
    uv_axes=_uv_axes,
    corners=_corners,
    hull=flat.hull(((-1, -1), (1, -1), (-1, 1), (1, 1))),
    areas=flat.areas(float(np.pi)),
    orientation=flat.orientation,
)
