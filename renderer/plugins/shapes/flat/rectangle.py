"""Ray against parallelogram: the triangle's plane and (u, v), with both up to 1."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, kernel, table_columns
from renderer.kernels.lanes.functions import any_of, maximum, minimum
from renderer.kernels.lanes.memory import gather_row
from renderer.plugins.shapes.blocks import BLOCKS_OF, primitives_in
from renderer.plugins.shapes.flat import flat
from renderer.plugins.shapes.flat.patch import (
    MARGIN,
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
)
from renderer.scene_file.description import Rectangle


class Rectangles(NamedTuple):
    """Parallelograms: the corner at uv = (0, 0), the edges to (1, 0) and (0, 1)."""

    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) edge1 x edge2, not normalised
    breadth: NDArray[np.float32]  # (n,) |x| + |y| + |z| of the normal
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@kernel
def _inside(p):
    return (p.u >= 0.0) & (p.v >= 0.0) & (p.u <= p.scale) & (p.v <= p.scale)


@kernel
def hit_rectangle(rectangle, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max and 0 <= u, v <= 1."""
    always_inline()
    p = meet_plane(rectangle, origin, direction)
    depth = minimum(minimum(p.u, p.v), p.scale - maximum(p.u, p.v))
    doubtful = grazing(rectangle, p, direction) & (depth >= MARGIN * p.scale)
    if any_of(doubtful):
        p = meet_plane_in_double(rectangle, origin, direction, doubtful, p)
    return divided(p, _inside(p), t_max)


# ------------------------------------------------------------------ surface and light


@flat.with_parts
@table_columns("places")
class RectangleSurfaces(NamedTuple):
    """Parallelograms first .. end - 1 by primitive id."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2


@surface_point.by(RectangleSurfaces)
@kernel
def _point_on_rectangle(rectangles, index, mask, u, v, hit_point, with_uv):
    position, normal, offset = flat_point(rectangles, index, mask, u, v)
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, u, v)


@tangent_at.by(RectangleSurfaces)
@kernel
def _tangent_of_rectangle(rectangles, index, mask, u, v, normal):
    return gather_flat(rectangles, index, mask).edge1


@sample_shape.by(RectangleSurfaces)
@kernel
def _sample_rectangle(rectangles, kind, light, mask, position, x, y, z):
    """Choose a point, uniformly."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - rectangles.first
    p = gather_flat(rectangles, index, mask)
    point = p.corner + p.edge1 * x + p.edge2 * y
    side = p.normal * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, p.normal, side)


pdf_shape.by(RectangleSurfaces)(pdf_by_area)


# ---------------------------------------------------------------------------- tables


class RectangleBlocks(NamedTuple):
    """Corner, edges and normal of eight rectangles a block."""

    rows: NDArray[np.float32]  # (blocks, 12 * 8)
    id: NDArray[np.int32]
    count: int


BLOCKS_OF[Rectangles] = RectangleBlocks
primitive_at.by(Rectangles)(patch_at)
primitives_from.by(Rectangles)(patches_from)
primitive_at.by(RectangleBlocks)(patch_in)
primitives_in.by(RectangleBlocks)(patches_in)
hit_primitive.by(Rectangles, RectangleBlocks, drop_first=True)(hit_rectangle)


def read(properties: Any, common: dict[str, Any]) -> Rectangle:
    """Read the properties of a file."""
    properties.boolean("face_normals", False)  # flat anyway
    to_world = properties.transform("to_world")
    flip = properties.boolean("flip_normals", False)
    return Rectangle(**common, to_world=to_world, flip_normals=flip)


def surfaces(shapes: list[Rectangle], first: int) -> RectangleSurfaces:
    """Return the surfaces of shapes with primitive ids from `first` on."""
    x, y, center = flat.placed_axes(shapes)
    return flat.flat_surfaces(RectangleSurfaces, first, center - x - y, 2 * x, 2 * y)


def _corners(s: Any) -> list[NDArray[np.float32]]:
    points = [s.corner, s.corner + s.edge1, s.corner + s.edge2]
    return [*points, s.corner + s.edge1 + s.edge2]


RECTANGLES = ShapeKind(
    "rectangles",
    Rectangle,
    surfaces,
    flat.orientation,
    _corners,
    flat.hull(((0, 0), (1, 0), (0, 1), (1, 1))),
    flat.areas(1.0),
    flat.group(Rectangles),
    {"rectangle": read},
)
