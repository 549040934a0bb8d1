"""Ray against disk (under any affine map an ellipse): the plane, then u^2 + v^2 <= 1."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import any_of, fabs, select, splat_f32, sqrt
from renderer.kernels.lanes.memory import gather_row
from renderer.plugins.sampling.numbers_and_warps import square_to_disk
from renderer.plugins.shapes.blocks import BLOCKS_OF, primitives_in
from renderer.plugins.shapes.flat import flat
from renderer.plugins.shapes.flat.patch import (
    Intersection,
    divided,
    grazing,
    meet_plane,
    meet_plane_in_double,
    patch_at,
    patch_in,
    patches_from,
    patches_in,
)
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import hit_primitive, primitive_at, primitives_from
from renderer.plugins.shapes.surface import (
    LightPoint,
    SurfacePoint,
    flat_point,
    gather_flat,
    nowhere,
    pdf_by_area,
    pdf_shape,
    sample_shape,
    surface_point,
    tangent_at,
    turn,
)
from renderer.scene_file.description import Disk


class Disks(NamedTuple):
    """Disks: the corner is the centre, the edges are the two half axes."""

    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) edge1 x edge2, not normalised
    breadth: NDArray[np.float32]  # (n,) |x| + |y| + |z| of the normal
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@kernel
def _doubtful(disk, p, direction):
    around = (fabs(p.u) <= p.scale) & (fabs(p.v) <= p.scale)
    return around & grazing(disk, p, direction)


@kernel
def _within(p, t_max):
    # divided first: the squares of the undivided numbers of a tiny disk would underflow
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


@flat.with_parts
@table_columns("places")
class DiskSurfaces(NamedTuple):
    """Disks first .. end - 1 by primitive id; corner is the centre."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2


@surface_point.by(DiskSurfaces)
@kernel
def _point_on_disk(disks, index, mask, u, v, hit_point, with_uv):
    """Return the point; its texture coordinates are (radius, angle / 2 pi)."""
    position, normal, offset = flat_point(disks, index, mask, u, v)
    radius = sqrt(u * u + v * v)
    angle = turn(u, v) if with_uv != 0 else u * 0.0
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, radius, angle)


@tangent_at.by(DiskSurfaces)
@kernel
def _tangent_of_disk(disks, index, mask, x, y, normal):
    """Return the way outwards, as u is the distance from the centre; there, along x."""
    radius = sqrt(x * x + y * y)
    inverse = 1.0 / select(radius == 0.0, splat_f32(1.0), radius)
    cosine = select(radius == 0.0, splat_f32(1.0), x * inverse)
    p = gather_flat(disks, index, mask)
    return p.edge1 * cosine + p.edge2 * (y * inverse)


@sample_shape.by(DiskSurfaces)
@kernel
def _sample_disk(disks, kind, light, mask, position, x, y, z):
    """Choose a point, uniformly."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - disks.first
    u, v = square_to_disk(x, y)
    p = gather_flat(disks, index, mask)
    point = p.corner + p.edge1 * u + p.edge2 * v
    side = p.normal * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, p.normal, side)


pdf_shape.by(DiskSurfaces)(pdf_by_area)


# ---------------------------------------------------------------------------- tables


class DiskBlocks(NamedTuple):
    """Centre, edges and normal of eight disks a block."""

    rows: NDArray[np.float32]  # (blocks, 12 * 8)
    id: NDArray[np.int32]
    count: int


BLOCKS_OF[Disks] = DiskBlocks
primitive_at.by(Disks)(patch_at)
primitives_from.by(Disks)(patches_from)
primitive_at.by(DiskBlocks)(patch_in)
primitives_in.by(DiskBlocks)(patches_in)
hit_primitive.by(Disks, DiskBlocks, drop_first=True)(hit_disk)


def read(properties: Any, common: dict[str, Any]) -> Disk:
    """Read the properties of a file."""
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
    "disks",
    Disk,
    surfaces,
    flat.orientation,
    _corners,
    flat.hull(((-1, -1), (1, -1), (-1, 1), (1, 1))),
    flat.areas(float(np.pi)),
    flat.group(Disks),
    {"disk": read},
)
