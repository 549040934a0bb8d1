"""Ray against parallelogram: the triangle's plane test, with u and v in [0, 1]."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, kernel, table_columns
from renderer.kernels.lanes.functions import any_of, maximum, minimum
from renderer.kernels.lanes.vectors import cross, length
from renderer.kernels.records.kernel_scene import HALVES
from renderer.plugins.shapes import flat
from renderer.plugins.shapes.flat import (
    MARGIN,
    Patch,
    divided,
    grazing,
    meet_plane,
    meet_plane_in_double,
)
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import mirrors
from renderer.plugins.shapes.surface import (
    SurfacePoint,
    UvPoint,
    flat_light_point,
    flat_point,
    gather_flat,
    nowhere,
)
from renderer.plugins.shapes.uv import ByPrimitive
from renderer.scene_file.description import Rectangle


class Parallelogram(Patch):
    """`corner` is at uv = (0, 0); the edges lead to (1, 0) and (0, 1)."""


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


@table_columns("places")
class RectangleSurfaces(flat.FlatSurfaces):
    """Parallelograms."""


@kernel
def _point_on_rectangle(rectangles, index, mask, u, v, hit_point, with_uv):
    position, normal, offset = flat_point(rectangles, index, mask, u, v)
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, u, v)


@kernel
def _tangent_of_rectangle(rectangles, index, mask, u, v, normal):
    return gather_flat(rectangles, index, mask).edge1


@kernel
def _sample_rectangle(rectangles, kind, light, mask, position, x, y, z):
    """Choose a point, uniformly by area."""
    return flat_light_point(rectangles, kind, light, mask, position, x, y)


@kernel
def _at_uv(rectangles, chart, light, prim, orientation, u, v, mask):
    index = prim - rectangles.first
    p = gather_flat(rectangles, index, mask)
    position = p.corner + p.edge1 * u + p.edge2 * v
    area = length(cross(p.edge1, p.edge2))
    return UvPoint(position, p.normal * orientation, area, mask)


# ---------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Rectangle:
    """Read the properties of a `rectangle`."""
    properties.boolean("face_normals", False)  # ignored: a rectangle is flat
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


def _textured_side(shape: Rectangle) -> float:
    """Return the orientation without `flip_normals`, which Mitsuba ignores here.

    Mitsuba samples a textured, flipped rectangle on its front, although BSDF samples find
    emission on its back.
    """
    return -1.0 if mirrors(shape.to_world) else 1.0


def _derivatives(surfaces: Any, shapes: Any) -> ByPrimitive:
    """Return dp/du and dp/dv: u and v are in [0, 1] along edges of local length 2."""
    maps = np.array([shape.to_world for shape in shapes], float)
    columns = (np.ascontiguousarray(2.0 * maps[:, :3, k].T, np.float32) for k in (0, 1))
    return ByPrimitive(surfaces.first, surfaces.end, *columns)


RECTANGLES = ShapeKind(
    name="rectangles",
    plugins={"rectangle": read},
    description=Rectangle,
    record=RectangleSurfaces,
    surfaces=surfaces,
    primitive=Parallelogram,
    numbers=flat.numbers,
    intersect=hit_rectangle,
    surface_point=_point_on_rectangle,
    tangent=_tangent_of_rectangle,
    sample=_sample_rectangle,
    point_at_uv=_at_uv,
    corners=_corners,
    hull=flat.hull(((0, 0), (1, 0), (0, 1), (1, 1))),
    areas=flat.areas(1.0),
    derivatives=_derivatives,
    orientation=flat.orientation,
    other_textured_side=_textured_side,
    faces=lambda shape: np.full(1, HALVES),
)
