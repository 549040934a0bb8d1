"""Ray against open cylinder: the sphere's stable quadratic in the plane across the axis."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.kernel_scene import CylinderSurfaces
from renderer.lanes.functions import select, sqrt
from renderer.lanes.mathematics import sincos
from renderer.lanes.memory import gather_row, load_row
from renderer.sampling import TWO_PI
from renderer.shapes.patch import ZERO, Intersection
from renderer.shapes.sphere import ordered_roots
from renderer.shapes.surface import (
    ROUNDING,
    LightPoint,
    SurfacePoint,
    around_axis,
    magnitude,
    nowhere,
    pdf_by_area,
    pdf_shape,
    sample_shape,
    surface_point,
    tangent_at,
    turn,
)
from renderer.vectors import column, dot, gather3, gather_rows3, load3, normalize


class Cylinders(NamedTuple):
    """Tubes without caps, in the order of an accelerator."""

    base: NDArray[np.float32]  # (3, n) centre of the lower end
    axis: NDArray[np.float32]  # (3, n) unit
    radius: NDArray[np.float32]  # (n,)
    height: NDArray[np.float32]  # (n,)
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


class Cylinder(NamedTuple):
    """One cylinder, or 16 in lanes."""

    base: Any
    axis: Any
    radius: Any
    height: Any


@kernel
def cylinder_at(cylinders, k):
    """Return cylinder k as scalars."""
    return Cylinder(
        column(cylinders.base, k),
        column(cylinders.axis, k),
        cylinders.radius[k],
        cylinders.height[k],
    )


@kernel
def cylinders_from(cylinders, k):
    """Return cylinders k to k + 15 as lanes."""
    return Cylinder(
        load3(cylinders.base, k),
        load3(cylinders.axis, k),
        load_row(cylinders.radius, 0, k),
        load_row(cylinders.height, 0, k),
    )


@kernel
def hit_cylinder(cylinder, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max, v is the height as a fraction, u is 0.

    The nearer root counts where it lies between the ends, else the farther one: the ray
    may enter through an open end.
    """
    f = origin - cylinder.base
    f_axis = dot(f, cylinder.axis)
    d_axis = dot(direction, cylinder.axis)
    f_across = f - cylinder.axis * f_axis
    d_across = direction - cylinder.axis * d_axis
    a = dot(d_across, d_across)
    b = -dot(f_across, d_across)
    nearest = f_across + d_across * (b / a)
    discriminant = cylinder.radius * cylinder.radius - dot(nearest, nearest)
    root = sqrt(a * select(discriminant > 0.0, discriminant, ZERO * discriminant))
    q = b + select(b < 0.0, -root, root)
    c = dot(f_across, f_across) - cylinder.radius * cylinder.radius
    first, second = ordered_roots(q, a, c)
    h_first = f_axis + first * d_axis
    h_second = f_axis + second * d_axis
    near = (first > 0.0) & (h_first >= 0.0) & (h_first <= cylinder.height)
    far = (second > 0.0) & (h_second >= 0.0) & (h_second <= cylinder.height)
    t = select(near, first, second)
    hit = (discriminant >= 0.0) & (near | far) & (t <= t_max)
    return Intersection(hit, t, t * ZERO, select(near, h_first, h_second) / cylinder.height)


# ------------------------------------------------------------------ surface and light


@surface_point.by(CylinderSurfaces)
@kernel
def _point_on_cylinder(cylinders, index, mask, u, height, hit_point, with_uv):
    """Return the point; its texture coordinates are (angle / 2 pi, height)."""
    base = gather3(cylinders.base, index, mask)
    axis = gather_rows3(cylinders.frame, 6, index, mask)
    radius = gather_row(cylinders.radius, 0, index, mask)
    length = gather_row(cylinders.height, 0, index, mask)
    from_base = hit_point - base
    along = dot(from_base, axis)
    normal = normalize(from_base - axis * along)
    position = base + axis * along + normal * radius
    offset = (magnitude(base) + radius + length) * ROUNDING
    angle = height
    if with_uv != 0:
        x = dot(gather_rows3(cylinders.frame, 0, index, mask), normal)
        y = dot(gather_rows3(cylinders.frame, 3, index, mask), normal)
        angle = turn(x, y)
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, angle, height)


tangent_at.by(CylinderSurfaces)(around_axis)


@sample_shape.by(CylinderSurfaces)
@kernel
def _sample_cylinder(cylinders, kind, light, mask, position, x, y, z):
    """Choose a point of the tube, uniformly."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - cylinders.first
    sine, cosine = sincos(TWO_PI * y)
    frame = cylinders.frame
    local_x = gather_rows3(frame, 0, index, mask)
    local_y = gather_rows3(frame, 3, index, mask)
    axis = gather_rows3(frame, 6, index, mask)
    n = local_x * cosine + local_y * sine
    along = axis * (gather_row(cylinders.height, 0, index, mask) * x)
    point = gather3(cylinders.base, index, mask) + along
    point = point + n * gather_row(cylinders.radius, 0, index, mask)
    side = n * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, n, side)


pdf_shape.by(CylinderSurfaces)(pdf_by_area)
