"""Points of shapes by their (u, v): where a texture that shines is sampled.

|dp/du x dp/dv| turns a density over (u, v) into one over the area.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.mathematics.mathematics import sincos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import cross, gather3, gather_rows3, length
from renderer.plugins.sampling.numbers_and_warps import TWO_PI
from renderer.plugins.shapes.flat.disk import DiskSurfaces
from renderer.plugins.shapes.flat.rectangle import RectangleSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.plugins.shapes.surface import gather_flat

_PI = np.float32(np.pi)


class UvPoint(NamedTuple):
    """A point of a shape in 16 lanes."""

    position: Any  # in the world
    side: Any  # unit normal of the side that shines
    area: Any  # |dp/du x dp/dv|
    found: Any  # mask: the shape has a point there


@interface
def point_at_uv(
    surfaces: Any,
    chart: Any,
    light: Any,
    prim: Any,
    orientation: Any,
    u: Any,
    v: Any,
    mask: Any,
) -> UvPoint:
    """Return the points of area lights at (u, v).

    Parameters
    ----------
    chart
        Of meshes: where each triangle lies in (u, v).
    prim
        The primitive, where the light has only one.
    orientation
        -1 where the outward normal is flipped.
    """


@point_at_uv.by(RectangleSurfaces)
@kernel
def _on_rectangle(rectangles, chart, light, prim, orientation, u, v, mask):
    index = prim - rectangles.first
    p = gather_flat(rectangles, index, mask)
    position = p.corner + p.edge1 * u + p.edge2 * v
    area = length(cross(p.edge1, p.edge2))
    return UvPoint(position, p.normal * orientation, area, mask)


@point_at_uv.by(DiskSurfaces)
@kernel
def _on_disk(disks, chart, light, prim, orientation, u, v, mask):
    index = prim - disks.first
    p = gather_flat(disks, index, mask)
    sine, cosine = sincos(TWO_PI * v)
    position = p.corner + (p.edge1 * cosine + p.edge2 * sine) * u
    per_area = length(cross(p.edge1, p.edge2)) * (TWO_PI * u)
    return UvPoint(position, p.normal * orientation, per_area, mask)


@kernel
def _around(frame, index, angle, mask):
    sine, cosine = sincos(angle)
    x, y = gather_rows3(frame, 0, index, mask), gather_rows3(frame, 3, index, mask)
    return x * cosine + y * sine


@point_at_uv.by(SphereSurfaces)
@kernel
def _on_sphere(spheres, chart, light, prim, orientation, u, v, mask):
    index = prim - spheres.first
    radius = gather_row(spheres.radius, 0, index, mask)
    sine, cosine = sincos(_PI * v)
    n = _around(spheres.frame, index, TWO_PI * u, mask) * sine
    n = n + gather_rows3(spheres.frame, 6, index, mask) * cosine
    position = gather3(spheres.center, index, mask) + n * radius
    area = (TWO_PI * _PI) * radius * radius * sine
    return UvPoint(position, n * orientation, area, mask)
