"""Ray against linear curve: cones tangent to a ball at both ends, and the balls.

A segment is a cone, the ball at its end and, for the first segment of a curve, the ball at
its start. Together they are the convex hull of two balls for each segment [Han2019]. With
unit axis e, radius r0 + k z and slope k, the cone is rho^2 (1 - k^2) = (r0 + k z)^2 at
height z and distance rho from the axis. There is no cone if one ball contains the other.

In a bend a part of each segment lies inside of the next one. Rays from outside never hit
that part. For a ray that starts inside, hits on the ball that lie inside of the next cone
are dropped, but hits on cones are not. Embree does the same in Mitsuba, by measurement.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.fields import Number, Vector
from renderer.kernels.lanes.functions import any_of, maximum, minimum, select, sqrt
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.kernels.lanes.vectors import dot, vec3
from renderer.plugins.shapes.curves import (
    CurveSurfaces,
    angle_around,
    first_points,
    read_curves,
    record,
    unit_or,
    upwards,
)
from renderer.plugins.shapes.flat import ONE, ZERO
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import Intersection
from renderer.plugins.shapes.scalar_shapes import INFINITY
from renderer.plugins.shapes.surface import ROUNDING, SurfacePoint, magnitude, nowhere
from renderer.scene_file.description import LinearCurve

# The ball is also hit up to this far (in radii) behind the circle where the cone touches
# it. There both surfaces agree within 5e-7 radii, and rounding leaves no gap.
_OVERLAP = np.float32(1e-3)
# Hits are dropped inside of the next cone with its squared radius times this. Otherwise
# rounding would drop hits where one surface continues the other.
_WITHIN = np.float32(1.0 - 1e-5)
_CLOSE = np.float32(1.001)  # rays farther from the axis than this many radii cannot hit


class Segment(NamedTuple):
    """One segment, or 16 in lanes; `after` is 0 if no segment follows."""

    begin: Vector
    radius: Number
    axis: Vector  # from begin to end
    growth: Number  # change of the radius from begin to end
    leads: Number  # 1 for the first segment of its curve, else 0
    after: Vector  # `axis` of the next segment
    after_growth: Number


@kernel
def _unless_in_next(segment, p, d, t):
    """Return t, or infinity if p + t d (relative to the end) is inside of the next cone."""
    at, axis = p + d * t, segment.after
    square = dot(axis, axis)
    inverse = ONE / sqrt(square)  # infinite without a next segment: comparisons are false
    e, slope = axis * inverse, segment.after_growth * inverse
    radius = segment.radius + segment.growth
    z = dot(at, e)
    across = at - e * z
    rest = ONE - slope * slope
    here, along = radius + slope * z, z + radius * slope
    within = (along >= ZERO) & (along <= rest * (square * inverse))
    within = within & (rest * dot(across, across) < here * here * _WITHIN)
    return select(within, INFINITY, t)


@kernel
def _enter_ball(f, d, d_squared, radius):
    """Return the discriminant and the smaller t with |f + t d| = radius [Haines2019]."""
    middle = -dot(f, d) / d_squared
    nearest = f + d * middle
    discriminant = radius * radius - dot(nearest, nearest)
    half = sqrt(maximum(discriminant, ZERO) / d_squared)
    return discriminant, middle - half


@kernel
def hit_segment(segment, origin, direction, t_max):
    """Intersect where the ray enters: 0 < t <= t_max; v is the place on the axis in [0, 1].

    Coordinates are relative to the point of the axis nearest to the ray, and t starts at
    the point of the ray nearest to that. So a distant origin causes no cancellation.
    """
    d, axis = direction, segment.axis
    f = origin - segment.begin
    d_squared, d_axis, squared = dot(d, d), dot(d, axis), dot(axis, axis)
    f_axis, f_d = dot(f, axis), dot(f, d)
    s = (f_axis * d_squared - f_d * d_axis) / (squared * d_squared - d_axis * d_axis)
    s = minimum(maximum(s, ZERO), ONE)
    near = f - axis * s
    start = -dot(near, d) / d_squared
    o = near + d * start
    zero = start * ZERO  # in lanes if the rays or the segments are in lanes
    thickest = maximum(segment.radius, segment.radius + segment.growth) * _CLOSE
    close = dot(o, o) <= thickest * thickest
    if not any_of(close):
        return Intersection(close, zero, zero, zero)

    length = sqrt(squared)
    inverse = select(length > ZERO, ONE / length, ZERO)
    e, slope = axis * inverse, segment.growth * inverse
    rest = ONE - slope * slope + zero
    has_cone = (rest > ZERO) & (length + zero > ZERO)
    radius = segment.radius + segment.growth * s
    z, d_z = dot(o, e), dot(d, e)
    across, d_across = o - e * z, d - e * d_z
    here, d_here = radius + slope * z, slope * d_z
    a = rest * dot(d_across, d_across) - d_here * d_here
    b = rest * dot(across, d_across) - d_here * here
    c = rest * dot(across, across) - here * here
    discriminant = b * b - a * c
    root = sqrt(maximum(discriminant, ZERO))
    # the root where the ray enters; of its two forms the one without cancellation
    t_cone = select(b > ZERO, -(b + root) / a, c / (root - b))
    v_cone = s + (z + t_cone * d_z + radius * slope) / rest * inverse
    met = has_cone & (discriminant > ZERO) & (v_cone >= ZERO) & (v_cone <= ONE)
    met = met & (start + t_cone > ZERO)
    from_end = o - axis * (ONE - s)
    t_cone = select(met, t_cone, INFINITY)

    end_radius = segment.radius + segment.growth
    found, t_end = _enter_ball(from_end, d, d_squared, end_radius)
    beyond = dot(from_end + d * t_end, e) + end_radius * slope + end_radius * _OVERLAP
    met = (found > ZERO) & ((beyond > ZERO) | (rest <= ZERO) | (length + zero <= ZERO))
    met = met & (start + t_end > ZERO)
    t_end = _unless_in_next(segment, from_end, d, select(met, t_end, INFINITY))

    from_begin = o + axis * s
    found, t_begin = _enter_ball(from_begin, d, d_squared, segment.radius)
    beyond = dot(from_begin + d * t_begin, e) + segment.radius * slope
    beyond = beyond - segment.radius * _OVERLAP
    met = (found > ZERO) & ((beyond < ZERO) | (rest <= ZERO) | (length + zero <= ZERO))
    met = met & (segment.leads + zero > ZERO) & (start + t_begin > ZERO)
    t_begin = select(met, t_begin, INFINITY)

    nearest = minimum(minimum(t_cone, t_end), t_begin)
    v = select(nearest == t_end, zero + ONE, zero)
    v = select(nearest == t_cone, v_cone, v)
    t = start + nearest
    hit = close & (nearest < INFINITY) & (t > ZERO) & (t <= t_max)
    return Intersection(hit, t, zero, v)


# ------------------------------------------------------------------------------ surface


@table_columns("numbers")
class LinearSegments(CurveSurfaces):
    """Segments; `numbers` are the fields of `Segment`."""


@kernel
def _point_on_segment(segments, index, mask, u, v, hit_point, with_uv):
    """Return the point on the ball around the axis at v."""
    x, y, z, radius = gather_columns(segments.numbers, 0, index, mask)
    a, b, c, growth = gather_columns(segments.numbers, 4, index, mask)
    begin, axis = vec3(x, y, z), vec3(a, b, c)
    radius = radius + growth * v
    center = begin + axis * v
    normal = unit_or(hit_point - center, upwards(v))
    position = center + normal * radius
    offset = (magnitude(begin) + magnitude(axis) + radius) * ROUNDING
    angle, along = v, v
    if with_uv != 0:
        angle = angle_around(unit_or(axis, upwards(v)), normal)
        begins = gather_row(segments.place, 0, index, mask)
        along = begins + gather_row(segments.place, 1, index, mask) * v
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, angle, along)


@kernel
def _no_tangent(segments, index, mask, u, v, normal):
    """Return 0: Mitsuba has no dp/du here; frames are built from the normal alone."""
    return normal * 0.0


# ------------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> LinearCurve:
    """Read the properties of a `linearcurve`."""
    return read_curves(properties, common, LinearCurve, 2)


def surfaces(shapes: list[LinearCurve], first: int) -> LinearSegments:
    """Return the segments of shapes with primitive ids from `first` on."""
    numbers, places = [], []
    for shape in shapes:
        points, begins = shape.points, first_points(shape, 2)
        count = len(begins)
        here, end = points[begins], points[begins + 1]
        leads = np.isin(begins, shape.starts)[:, None]
        after = np.zeros_like(here)
        follows = np.flatnonzero(np.diff(begins) == 1)  # has a next segment in its curve
        after[follows] = (end[1:] - end[:-1])[follows]
        numbers.append(np.hstack([here, end - here, leads, after]))
        places.append(np.stack([np.arange(count), np.ones(count)], 1) / count)
    table: LinearSegments = record(LinearSegments, first, numbers, places)
    return table


def _balls(s: Any, order: Any) -> tuple[Any, ...]:
    """Return the centres (3, n) and radii (n,) of the balls at both ends."""
    begin, axis = s.numbers[:4, order], s.numbers[4:8, order]
    end = begin + axis
    return begin[:3], begin[3], end[:3], end[3]


def _corners(s: Any) -> list[NDArray[np.float32]]:
    begin, radius, end, end_radius = _balls(s, slice(None))
    return [begin - radius, begin + radius, end - end_radius, end + end_radius]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    begin, radius, end, end_radius = _balls(s, order)
    points = np.stack([begin, end, begin, end], 1)
    return points, np.maximum(radius, end_radius), np.zeros(begin.shape, np.float32)


LINEAR_SEGMENTS = ShapeKind(
    name="linear_segments",
    plugins={"linearcurve": read},
    description=LinearCurve,
    record=LinearSegments,
    surfaces=surfaces,
    primitive=Segment,
    numbers=lambda s, columns: (s.numbers[:, columns],),
    intersect=hit_segment,
    surface_point=_point_on_segment,
    tangent=_no_tangent,
    corners=_corners,
    hull=_hull,
    orientation=lambda shape: 1.0,
    faces=lambda shape: np.arange(len(first_points(shape, 2))),
)
