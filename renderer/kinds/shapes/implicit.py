"""Implicit surface: all points of a box with g(x, y, z) = 0, for any function g.

The normal is the gradient of g, so that a g that is negative inside has its normals
outside. One program on a stack evaluates all functions (`intervals`), and roots are found
with a guarantee (`roots`): the lecture's general isosurface. Mitsuba has no such shape.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.jit import kernel, never_inline
from renderer.kinds.shapes.arrays import float32
from renderer.kinds.shapes.intervals import Interval, Steps, along_line
from renderer.kinds.shapes.kind import ShapeKind, flipped
from renderer.kinds.shapes.patch import Intersection
from renderer.kinds.shapes.primitives import hit_primitive, primitive_at, primitives_from
from renderer.kinds.shapes.roots import first_root
from renderer.kinds.shapes.surface import (
    ROUNDING,
    SurfacePoint,
    nowhere,
    surface_point,
    tangent_at,
)
from renderer.lanes.functions import lane, mask_bits
from renderer.lanes.local import local_f32
from renderer.lanes.memory import gather_row, load_row
from renderer.lanes.types import Lanes
from renderer.lanes.vectors import orthonormal_basis, vec3
from renderer.scene_file.description import Implicit
from renderer.scene_file.document.tree import Function
from renderer.scene_file.objects.expressions import (
    ExpressionError,
    Program,
    parse_expression,
    trace_function,
)

_INFINITY = np.float32(np.inf)
_WIDER = 1.0 + 2.0**-40  # boxes, against the rounding of where a ray meets them


class ImplicitSurfaces(NamedTuple):
    """Surfaces first .. end - 1 by primitive id."""

    first: int
    end: int
    lower: NDArray[np.float64]  # (3, n) of the box, in the shape's own space
    upper: NDArray[np.float64]  # (3, n)
    to_world: NDArray[np.float64]  # (12, n) rows
    to_object: NDArray[np.float64]  # (12, n) rows
    size: NDArray[np.float32]  # (n,) largest coordinate in the world
    begin: NDArray[np.int64]  # (n,) first operation of its program
    finish: NDArray[np.int64]  # (n,) the one after its last
    operations: NDArray[np.int32]  # (m,) of all programs
    operands: NDArray[np.float64]  # (m,)


class Implicits(NamedTuple):
    """Surfaces in the order of an accelerator."""

    column: NDArray[np.int32]  # (n,) of `surfaces`; padded by -1
    surfaces: ImplicitSurfaces
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


# ------------------------------------------------------------------------- one surface


@kernel
def _point(m, k, p):
    return vec3(
        m[0, k] * p.x + m[1, k] * p.y + m[2, k] * p.z + m[3, k],
        m[4, k] * p.x + m[5, k] * p.y + m[6, k] * p.z + m[7, k],
        m[8, k] * p.x + m[9, k] * p.y + m[10, k] * p.z + m[11, k],
    )


@kernel
def _vector(m, k, a):
    return vec3(
        m[0, k] * a.x + m[1, k] * a.y + m[2, k] * a.z,
        m[4, k] * a.x + m[5, k] * a.y + m[6, k] * a.z,
        m[8, k] * a.x + m[9, k] * a.y + m[10, k] * a.z,
    )


@kernel
def _in_double(a):
    return vec3(np.float64(a.x), np.float64(a.y), np.float64(a.z))


@kernel
def _program(surfaces, k):
    return Steps(
        surfaces.operations, surfaces.operands, surfaces.begin[k], surfaces.finish[k]
    )


@kernel
def _between(low, high, origin, direction, near, far):
    """Return the part of [near, far] in which a ray is between two planes of an axis."""
    if direction == 0.0:
        if low <= origin <= high:
            return near, far
        return 1.0, 0.0
    a, b = (low - origin) / direction, (high - origin) / direction
    a, b = min(a, b), max(a, b)
    a -= abs(a) * (_WIDER - 1.0)
    b += abs(b) * (_WIDER - 1.0)
    return max(near, a), min(far, b)


@kernel
def hit_surface(surfaces, k, origin, direction, t_max):
    """Return t of the first hit with 0 < t <= t_max, infinite if there is none."""
    never_inline()
    if k < 0 or not (t_max > 0.0):
        return _INFINITY
    o = _point(surfaces.to_object, k, _in_double(origin))
    d = _vector(surfaces.to_object, k, _in_double(direction))
    near, far = 0.0, np.float64(t_max)
    low, high = surfaces.lower, surfaces.upper
    near, far = _between(low[0, k], high[0, k], o.x, d.x, near, far)
    near, far = _between(low[1, k], high[1, k], o.y, d.y, near, far)
    near, far = _between(low[2, k], high[2, k], o.z, d.z, near, far)
    if not near <= far < np.inf:
        # a ray without end leaves the box, unless it goes nowhere
        return _INFINITY
    t, _ = first_root(_program(surfaces, k), o, d, near, far)
    rounded = np.float32(t)
    return rounded if rounded > 0.0 else _INFINITY


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
    """Return the point of surface k next to one that is on it but for rounding, and n.

    A Newton step along the gradient; where the gradient is 0, at a cusp, the point stays
    and the normal is z.
    """
    never_inline()
    program = _program(surfaces, k)
    p = _point(surfaces.to_object, k, _in_double(hit_point))
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
    m = surfaces.to_object  # normals go by the inverse transpose
    n = vec3(
        m[0, k] * g.x + m[4, k] * g.y + m[8, k] * g.z,
        m[1, k] * g.x + m[5, k] * g.y + m[9, k] * g.z,
        m[2, k] * g.x + m[6, k] * g.y + m[10, k] * g.z,
    )
    length = np.sqrt(n.x * n.x + n.y * n.y + n.z * n.z)
    if not 0.0 < length < np.inf:
        return _point(surfaces.to_world, k, p), vec3(0.0, 0.0, 1.0)
    return _point(surfaces.to_world, k, p), vec3(n.x / length, n.y / length, n.z / length)


# ------------------------------------------------- as accelerators and stages ask for it


def _pick(x: Any, j: int) -> Any:
    """Return a number, or lane j of some."""
    raise TypeError("inside kernels only")


@overload(_pick)
def _pick_one(x, j):
    if isinstance(x, Lanes):
        return lambda x, j: lane(x, j)
    return lambda x, j: x


def _hit(surfaces: Any, k: Any, origin: Any, direction: Any, t_max: Any) -> Intersection:
    """Intersect one ray with one surface, or 16 of either with one of the other."""
    raise TypeError("inside kernels only")


@overload(_hit)
def _hit_in_lanes(surfaces, k, origin, direction, t_max):
    if isinstance(k, types.Integer) and isinstance(t_max, types.Float):

        def one(surfaces, k, origin, direction, t_max):
            t = hit_surface(surfaces, k, origin, direction, t_max)
            zero = np.float32(0.0)
            return Intersection(t < _INFINITY, t, zero, zero)

        return one

    def sixteen(surfaces, k, origin, direction, t_max):
        found = local_f32(16)
        for j in range(16):
            o = vec3(_pick(origin.x, j), _pick(origin.y, j), _pick(origin.z, j))
            d = vec3(_pick(direction.x, j), _pick(direction.y, j), _pick(direction.z, j))
            found[j] = hit_surface(surfaces, _pick(k, j), o, d, _pick(t_max, j))
        t = load_row(found, 0, 0)
        return Intersection(t < _INFINITY, t, t * 0.0, t * 0.0)

    return sixteen


@primitive_at.by(Implicits)
@kernel
def _implicit_at(group, k):
    return group.column[k]


@primitives_from.by(Implicits)
@kernel
def _implicits_from(group, k):
    return load_row(group.column, 0, k)


@hit_primitive.by(Implicits)
@kernel
def _hit_implicit(group, primitive, origin, direction, t_max):
    return _hit(group.surfaces, primitive, origin, direction, t_max)


@surface_point.by(ImplicitSurfaces)
@kernel
def _point_on_implicit(surfaces, index, mask, u, v, hit_point, with_uv):
    """Return the point; it has no texture coordinates."""
    rows = local_f32(96)
    bits = mask_bits(mask)
    for j in range(16):
        p = vec3(lane(hit_point.x, j), lane(hit_point.y, j), lane(hit_point.z, j))
        n = vec3(0.0, 0.0, 1.0)
        q = _in_double(p)
        if (bits >> j) & 1 != 0:
            q, n = point_and_normal(surfaces, lane(index, j), p)
        rows[j], rows[16 + j], rows[32 + j] = q.x, q.y, q.z
        rows[48 + j], rows[64 + j], rows[80 + j] = n.x, n.y, n.z
    position = vec3(load_row(rows, 0, 0), load_row(rows, 0, 16), load_row(rows, 0, 32))
    normal = vec3(load_row(rows, 0, 48), load_row(rows, 0, 64), load_row(rows, 0, 80))
    offset = gather_row(surfaces.size, 0, index, mask) * ROUNDING
    nothing = normal.x * 0.0
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, nothing, nothing)


@tangent_at.by(ImplicitSurfaces)
@kernel
def _tangent_of_implicit(surfaces, index, mask, u, v, normal):
    """Return any direction across the normal: there is no u."""
    s, _ = orthonormal_basis(normal)
    return s


# ------------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Implicit:
    """Read the properties of a file."""
    if common["radiance"] is not None:
        raise SceneError(
            f"{properties.location}: {properties.element} cannot emit: its area is not "
            "known; a mesh or a sphere can"
        )
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
            "one beside an expression" if given else "nothing",
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
    rows = (m[:, :3].reshape(-1, 12).T for m in (placed, np.linalg.inv(placed)))
    bounds = np.array([shape.bounds for shape in shapes])  # (n, 2, 3)
    steps = [len(shape.program.operations) for shape in shapes]
    ends = np.cumsum(steps)
    of_all = ImplicitSurfaces(
        first,
        first + len(shapes),
        np.ascontiguousarray(bounds[:, 0].T),
        np.ascontiguousarray(bounds[:, 1].T),
        *(np.ascontiguousarray(m) for m in rows),
        np.zeros(len(shapes), np.float32),
        ends - steps,
        ends,
        np.concatenate([shape.program.operations for shape in shapes]),
        np.concatenate([shape.program.operands for shape in shapes]),
    )
    return of_all._replace(size=float32(np.abs(_world_corners(of_all)).max(axis=(0, 1))))


def _world_corners(s: ImplicitSurfaces) -> NDArray[np.float64]:
    """Return the corners of the boxes in the world, (8, 3, n)."""
    ends = np.stack([s.lower, s.upper])  # (2, 3, n)
    chosen = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    local = np.stack([ends[chosen[:, axis], axis] for axis in range(3)], axis=1)
    m = s.to_world.reshape(3, 4, -1)
    return np.einsum("abn,cbn->can", m[:, :3], local) + m[:, 3]


def _corners(s: Any) -> list[NDArray[np.float32]]:
    return [float32(corner) for corner in _world_corners(s)]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    """Return the middle of each box, grown to its corners."""
    corners = _world_corners(s)[:, :, order]
    middle = corners.mean(axis=0)
    radius = np.linalg.norm(corners - middle, axis=1).max(axis=0)
    points = np.repeat(middle[:, None], 4, axis=1)
    return points, radius, np.zeros((3, len(order)), np.float32)


def _areas(s: Any, k: Any) -> NDArray[np.float64]:
    return np.zeros(len(k))  # nobody knows; none is a lamp


def _group(s: Any, order: Any, ids: Any, padded: Any) -> Implicits:
    # -1 is no surface: lanes beyond the last are not worth a search for roots
    column = np.pad(np.asarray(order, np.int32), (0, 16), constant_values=-1)
    return Implicits(column, s, ids, len(order))


IMPLICITS = ShapeKind(
    "implicits",
    Implicit,
    surfaces,
    flipped,
    _corners,
    _hull,
    _areas,
    _group,
    {"implicit": read},
    wide=False,
)
