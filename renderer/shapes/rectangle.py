"""Ray against parallelogram: the triangle's plane and (u, v), with both up to 1."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.kernel_scene import RectangleSurfaces
from renderer.lanes.functions import any_of
from renderer.lanes.memory import gather_row
from renderer.shapes.patch import (
    MARGIN,
    divided,
    grazing,
    greater,
    lesser,
    meet_plane,
    meet_plane_in_double,
)
from renderer.shapes.surface import (
    LightPoint,
    SurfacePoint,
    flat_point,
    nowhere,
    pdf_by_area,
    pdf_shape,
    sample_shape,
    surface_point,
    tangent_at,
)
from renderer.vectors import gather3


class Rectangles(NamedTuple):
    """Parallelograms: the corner at uv = (0, 0), the edges to (1, 0) and (0, 1)."""

    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) edge1 x edge2, not normalised
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@kernel
def _inside(p):
    return (p.u >= 0.0) & (p.v >= 0.0) & (p.u <= p.scale) & (p.v <= p.scale)


@kernel
def hit_rectangle(rectangle, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max and 0 <= u, v <= 1."""
    p = meet_plane(rectangle, origin, direction)
    depth = lesser(lesser(p.u, p.v), p.scale - greater(p.u, p.v))
    doubtful = grazing(rectangle, p, direction) & (depth >= MARGIN * p.scale)
    if any_of(doubtful):
        p = meet_plane_in_double(rectangle, origin, direction, doubtful, p)
    return divided(p, _inside(p), t_max)


# ------------------------------------------------------------------ surface and light


@surface_point.by(RectangleSurfaces)
@kernel
def _point_on_rectangle(rectangles, index, mask, u, v, hit_point, with_uv):
    position, normal, offset = flat_point(rectangles, index, mask, u, v)
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, u, v)


@tangent_at.by(RectangleSurfaces)
@kernel
def _tangent_of_rectangle(rectangles, index, mask, u, v, normal):
    return gather3(rectangles.edge1, index, mask)


@sample_shape.by(RectangleSurfaces)
@kernel
def _sample_rectangle(rectangles, kind, light, mask, position, x, y, z):
    """Choose a point, uniformly."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - rectangles.first
    edge1 = gather3(rectangles.edge1, index, mask)
    edge2 = gather3(rectangles.edge2, index, mask)
    point = gather3(rectangles.corner, index, mask) + edge1 * x + edge2 * y
    n = gather3(rectangles.normal, index, mask)
    side = n * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, n, side)


pdf_shape.by(RectangleSurfaces)(pdf_by_area)
