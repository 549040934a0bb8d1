"""The shape `implicit`, g(x, y, z) = 0: first root along a ray, point and normal.

The root finder neither misses roots nor reports false ones.

[Mitchell1990]: An interval of t on which g cannot be 0 is skipped. If the derivative
cannot be 0 on it, it has at most one root, and it has one if g changes its sign. Any other
interval is halved. Two bounds exclude zeros of g: its interval extension, and the value at
the middle plus the slopes times half the width, which is much tighter near a root.
Intervals are visited in order of t, so the first root found is the smallest.

Limits: g is taken in double precision along the given ray, and every interval is rounded
outwards (`intervals`), so no root is missed. An interval of 2^-42 of the ray's length that
is still undecided counts as a root: there |g| is within rounding error of 0, as where a
ray touches the surface. Such a ray may in truth miss the surface by about 1e-13. If g is
unbounded even there, it is a pole and not a root.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, never_inline
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import column, local_f64, orthonormal_basis, vec3
from renderer.plugins.shapes.intervals import Interval, Steps, along_line
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import float32
from renderer.plugins.shapes.scalar_shapes import (
    INFINITY,
    box_corners,
    hull_of_box,
    in_double,
    matrix_rows,
    placed_point,
    placed_vector,
    points_alone,
    refuse_lamp,
    unit_normal,
    within_box,
)
from renderer.plugins.shapes.surface import (
    ROUNDING,
    SurfacePoint,
    nowhere,
)
from renderer.scene_file.description import Implicit
from renderer.scene_file.objects.expressions import (
    ExpressionError,
    Program,
    parse_expression,
    trace_function,
)
from renderer.scene_file.tree import Function

_NARROWEST = 2.0**-42  # smallest width of an interval, relative to the ray's ends
_STACK = 64  # capacity for halved intervals; _NARROWEST needs 42
_STEPS = 64  # steps of Newton's method, or bisections, each of which gains one bit
_ROUNDING = 1.0 + 2.0**-50


@kernel
def _has_zero(a):
    return a.low <= 0.0 and a.high >= 0.0


@kernel
def _around_middle(value, slope, half):
    """Return the interval of the values that g can have within `half` of a point."""
    reach = max(abs(slope.low), abs(slope.high)) * half * _ROUNDING if half > 0.0 else 0.0
    return Interval(
        (value.low - reach) - abs(value.low - reach) * 2.0**-50,
        (value.high + reach) + abs(value.high + reach) * 2.0**-50,
    )


@kernel
def _sign(a):
    """Return 1 or -1 if all of an interval has that sign, else 0."""
    if a.low > 0.0:
        return 1
    return -1 if a.high < 0.0 else 0


@kernel
def _refined(program, origin, direction, near, far, increasing):
    """Return the root in [near, far], where g is monotone, by safeguarded Newton steps."""
    t = 0.5 * (near + far)
    steps = 0
    while steps < _STEPS:
        steps += 1
        value, slope = along_line(program, origin, direction, Interval(t, t))
        if _has_zero(value):
            break
        if (value.low > 0.0) == increasing:
            far = t
        else:
            near = t
        new = t - (value.low + value.high) / (slope.low + slope.high)
        if not (near < new < far):
            new = 0.5 * (near + far)
        if new == t or not (near < new < far):
            break
        t = new
    return t, steps


@kernel
def first_root(program, origin, direction, near, far):
    """Return the smallest t in [near, far] with g = 0, and the number of evaluations of g.

    t is infinite if g has no root. `origin` and `direction` are double precision.
    """
    never_inline()
    ends = local_f64(64)
    depth = 0
    narrowest = _NARROWEST * max(abs(near), abs(far))
    count = 0
    while near <= far:
        value, slope = along_line(program, origin, direction, Interval(near, far))
        count += 1
        middle, half = 0.5 * (near + far), 0.5 * (far - near)
        if _has_zero(value):
            here, _ = along_line(program, origin, direction, Interval(middle, middle))
            count += 1
            if not _has_zero(slope):
                at_near, _ = along_line(program, origin, direction, Interval(near, near))
                at_far, _ = along_line(program, origin, direction, Interval(far, far))
                count += 2
                if _sign(at_near) * _sign(at_far) <= 0:
                    increasing = slope.low > 0.0
                    t, steps = _refined(program, origin, direction, near, far, increasing)
                    return t, count + steps
            elif _has_zero(_around_middle(here, slope, half)):
                if half > narrowest and depth < _STACK:
                    ends[depth] = far
                    depth += 1
                    far = middle
                    continue
                if value.high - value.low < np.inf:
                    return middle, count
        if depth == 0:
            break
        depth -= 1
        near, far = far, ends[depth]
    return np.inf, count


# ----------------------------------------------------------------------------- implicit
# Implicit surface: all points of a box with g(x, y, z) = 0, for any function g.
#
# The normal is the gradient of g: it points outwards if g is negative inside. A stack
# machine evaluates all functions (`intervals`), and the first root is found with a
# guarantee (`first_root`). This is the lecture's general isosurface. Mitsuba has no such
# shape.


class ImplicitSurfaces(NamedTuple):
    """Surfaces with primitive ids first .. end - 1."""

    first: int
    end: int
    lower: NDArray[np.float64]  # (3, n) lower corners of the boxes, object space
    upper: NDArray[np.float64]  # (3, n)
    to_world: NDArray[np.float64]  # (12, n) 3 x 4 matrices, by rows
    to_object: NDArray[np.float64]  # (12, n) their inverses
    size: NDArray[np.float32]  # (n,) largest absolute coordinate in world space
    begin: NDArray[np.int64]  # (n,) index of the first operation of its program
    finish: NDArray[np.int64]  # (n,) one past its last operation
    operations: NDArray[np.int32]  # (m,) of all programs
    operands: NDArray[np.float64]  # (m,)


# ------------------------------------------------------------------------- one surface


@kernel
def _program(surfaces, k):
    return Steps(
        surfaces.operations, surfaces.operands, surfaces.begin[k], surfaces.finish[k]
    )


@kernel
def _hit_surface(surfaces, k, origin, direction, t_max):
    never_inline()
    if k < 0 or not (t_max > 0.0):
        return INFINITY
    o = placed_point(surfaces.to_object, k, in_double(origin))
    d = placed_vector(surfaces.to_object, k, in_double(direction))
    lower, upper = column(surfaces.lower, k), column(surfaces.upper, k)
    near, far = within_box(lower, upper, o, d, t_max)
    if near > far:
        return INFINITY
    t, _ = first_root(_program(surfaces, k), o, d, near, far)
    rounded = np.float32(t)
    return rounded if rounded > 0.0 else INFINITY


@kernel
def _gradient(program, p):
    zero, one = 0.0, 1.0
    at = Interval(zero, zero)
    value, x = along_line(program, p, vec3(one, zero, zero), at)
    _, y = along_line(program, p, vec3(zero, one, zero), at)
    _, z = along_line(program, p, vec3(zero, zero, one), at)
    slope = vec3(0.5 * (x.low + x.high), 0.5 * (y.low + y.high), 0.5 * (z.low + z.high))
    return 0.5 * (value.low + value.high), slope


@kernel
def point_and_normal(surfaces, k, hit_point):
    """Return the point after one Newton step along the gradient, and its normal.

    Where the gradient is 0, as at a cusp, the point is unchanged and the normal is z.
    """
    never_inline()
    program = _program(surfaces, k)
    p = placed_point(surfaces.to_object, k, in_double(hit_point))
    reach = 1e-4 * max(
        surfaces.upper[0, k] - surfaces.lower[0, k],
        max(
            surfaces.upper[1, k] - surfaces.lower[1, k],
            surfaces.upper[2, k] - surfaces.lower[2, k],
        ),
    )
    value, g = _gradient(program, p)
    square = g.x * g.x + g.y * g.y + g.z * g.z
    if abs(value) <= reach * np.sqrt(square) and square > 0.0:
        step = value / square
        p = vec3(p.x - g.x * step, p.y - g.y * step, p.z - g.z * step)
        _, g = _gradient(program, p)
    n = unit_normal(surfaces.to_object, k, g, vec3(0.0, 0.0, 1.0))
    return placed_point(surfaces.to_world, k, p), n, n


@kernel
def _point_on_implicit(surfaces, index, mask, u, v, hit_point, with_uv):
    """Return the surface point; it has no texture coordinates."""
    position, normal, _ = points_alone(surfaces, index, mask, hit_point)
    offset = gather_row(surfaces.size, 0, index, mask) * ROUNDING
    nothing = normal.x * 0.0
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, nothing, nothing)


@kernel
def _tangent_at(surfaces, index, mask, u, v, normal):
    """Return any tangent: there is no u."""
    s, _ = orthonormal_basis(normal)
    return s


# ------------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Implicit:
    """Read the properties of an `implicit`."""
    refuse_lamp(properties, common)
    lower = np.array(properties.vector("bounds_min", (-1.0, -1.0, -1.0)))
    upper = np.array(properties.vector("bounds_max", (1.0, 1.0, 1.0)))
    if not (lower < upper).all():
        name = "bounds_max" if properties.has("bounds_max") else "bounds_min"
        properties.fail(
            name,
            f"a box from {tuple(map(float, lower))} to {tuple(map(float, upper))}",
            "each coordinate of bounds_min below that of bounds_max",
        )
    return Implicit(
        **common,
        to_world=properties.transform("to_world"),
        bounds=np.array([lower, upper]),
        program=_read_program(properties),
        flip_normals=properties.boolean("flip_normals", False),
    )


def _read_program(properties: Any) -> Program:
    given = [name for name in ("expression", "function") if properties.has(name)]
    if len(given) != 1:
        properties.fail(
            "function" if given else "expression",
            "one together with an expression" if given else "nothing",
            'an "expression" of x, y and z that is 0 on the surface; from Python, it may '
            'be a "function" instead',
        )
    (name,) = given
    value = properties.take(name).value
    wanted = str if name == "expression" else Function
    if not isinstance(value, wanted):
        kind = properties.element.properties[name].kind
        properties.fail(
            name, f"a value of type {kind}", "string" if wanted is str else "function"
        )
    try:
        if isinstance(value, Function):
            return trace_function(value.call)
        return parse_expression(value)
    except ExpressionError as error:
        properties.fail(name, str(error), "a function of x, y and z of this language")


def surfaces(shapes: list[Implicit], first: int) -> ImplicitSurfaces:
    """Return the surfaces of shapes with primitive ids from `first` on."""
    placed = np.array([shape.to_world for shape in shapes])
    bounds = np.array([shape.bounds for shape in shapes])  # (n, 2, 3)
    steps = [len(shape.program.operations) for shape in shapes]
    ends = np.cumsum(steps)
    of_all = ImplicitSurfaces(
        first,
        first + len(shapes),
        np.ascontiguousarray(bounds[:, 0].T),
        np.ascontiguousarray(bounds[:, 1].T),
        *matrix_rows(placed),
        np.zeros(len(shapes), np.float32),
        ends - steps,
        ends,
        np.concatenate([shape.program.operations for shape in shapes]),
        np.concatenate([shape.program.operands for shape in shapes]),
    )
    return of_all._replace(size=float32(np.abs(_world_corners(of_all)).max(axis=(0, 1))))


def _world_corners(s: ImplicitSurfaces) -> NDArray[np.float64]:
    return box_corners(s.lower, s.upper, s.to_world)


def _corners(s: Any) -> list[NDArray[np.float32]]:
    return [float32(corner) for corner in _world_corners(s)]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    return hull_of_box(_world_corners(s)[:, :, order])


IMPLICITS = ShapeKind(
    name="implicits",
    plugins={"implicit": read},
    description=Implicit,
    record=ImplicitSurfaces,
    surfaces=surfaces,
    primitive=None,
    intersect=_hit_surface,
    point=point_and_normal,
    surface_point=_point_on_implicit,
    tangent=_tangent_at,
    corners=_corners,
    hull=_hull,
)
