"""Kinds of primitives that are intersected one at a time, in double precision.

Such a kind has a record of surfaces and implements `intersect_scalar` and `point_alone`.
This file derives from them the kernels that accelerators and stages call, for one ray or
for 16 lanes. It also has the transforms for shapes with an object space: rows 0 to 11 of
a column are a 3 x 4 matrix.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import lane, mask_bits
from renderer.kernels.lanes.memory import load_eight, load_row
from renderer.kernels.lanes.types import Lanes
from renderer.kernels.lanes.vectors import local_f32, vec3
from renderer.plugins.shapes.primitives import (
    Intersection,
    intersect,
    primitive_at,
    primitives_from,
)

INFINITY = np.float32(np.inf)
_WIDER = 1.0 + 2.0**-40  # widens ray-box intervals against rounding


class ScalarPrimitive(NamedTuple):
    """One primitive, or 16 in lanes."""

    column: Any  # of the table of surfaces
    surfaces: Any


class ScalarGroup(NamedTuple):
    """Primitives in the order of an accelerator."""

    column: NDArray[np.int32]  # (n,) of `surfaces`; padded with -1
    surfaces: Any
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@interface
def intersect_scalar(surfaces: Any, k: Any, origin: Any, direction: Any, t_max: Any) -> Any:
    """Return t of the first hit with 0 < t <= t_max, infinite without a hit.

    Column -1 is never hit.
    """


@interface
def point_alone(surfaces: Any, k: Any, hit_point: Any) -> Any:
    """Return the point of surface k nearest to `hit_point`, which has rounding error.

    Returns position, normal and shading normal, all in double precision.
    """


# --------------------------------------------------------------------- object spaces


@kernel
def placed_point(m, k, p):
    """Return the point p, transformed by matrix k."""
    return vec3(
        m[0, k] * p.x + m[1, k] * p.y + m[2, k] * p.z + m[3, k],
        m[4, k] * p.x + m[5, k] * p.y + m[6, k] * p.z + m[7, k],
        m[8, k] * p.x + m[9, k] * p.y + m[10, k] * p.z + m[11, k],
    )


@kernel
def placed_vector(m, k, a):
    """Return the vector a, transformed by matrix k."""
    return vec3(
        m[0, k] * a.x + m[1, k] * a.y + m[2, k] * a.z,
        m[4, k] * a.x + m[5, k] * a.y + m[6, k] * a.z,
        m[8, k] * a.x + m[9, k] * a.y + m[10, k] * a.z,
    )


@kernel
def unit_normal(m, k, g, otherwise):
    """Return the world space unit normal for the gradient g; `otherwise` where g is 0.

    Matrix k is world-to-object; its transpose transforms normals to world space.
    """
    x = m[0, k] * g.x + m[4, k] * g.y + m[8, k] * g.z
    y = m[1, k] * g.x + m[5, k] * g.y + m[9, k] * g.z
    z = m[2, k] * g.x + m[6, k] * g.y + m[10, k] * g.z
    length = np.sqrt(x * x + y * y + z * z)
    if not 0.0 < length < np.inf:
        return otherwise
    return vec3(x / length, y / length, z / length)


@kernel
def in_double(a):
    """Return a vector in double precision."""
    return vec3(np.float64(a.x), np.float64(a.y), np.float64(a.z))


@kernel
def between(low, high, origin, direction, near, far):
    """Return the part of [near, far] where a ray is between two axis-aligned planes."""
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
def within_box(lower, upper, o, d, t_max):
    """Return the interval [near, far] of t where a ray is inside of a box.

    near > far means that it misses the box. An infinite `far` also counts as a miss: it
    occurs only for a ray with direction 0.
    """
    near, far = 0.0, np.float64(t_max)
    near, far = between(lower.x, upper.x, o.x, d.x, near, far)
    near, far = between(lower.y, upper.y, o.y, d.y, near, far)
    near, far = between(lower.z, upper.z, o.z, d.z, near, far)
    if not near <= far < np.inf:
        return 1.0, 0.0
    return near, far


# -------------------------------------------------------- for accelerators and stages


def _pick(x: Any, j: int) -> Any:
    """Return lane j of lanes, or a scalar unchanged."""
    raise TypeError("inside kernels only")


@overload(_pick)
def _pick_one(x, j):
    if isinstance(x, Lanes):
        return lambda x, j: lane(x, j)
    return lambda x, j: x


def _hit(surfaces: Any, k: Any, origin: Any, direction: Any, t_max: Any) -> Intersection:
    """Intersect rays with surfaces; either may be a scalar or 16 or 8 lanes."""
    raise TypeError("inside kernels only")


@overload(_hit)
def _hit_in_lanes(surfaces, k, origin, direction, t_max):
    if isinstance(k, types.Integer) and isinstance(t_max, types.Float):

        def one(surfaces, k, origin, direction, t_max):
            t = intersect_scalar(surfaces, k, origin, direction, t_max)
            zero = np.float32(0.0)
            return Intersection(t < INFINITY, t, zero, zero)

        return one

    width = getattr(k, "width", 0) or t_max.width
    load = load_row if width == 16 else load_eight

    def each(surfaces, k, origin, direction, t_max):
        found = local_f32(16)
        for j in range(width):
            o = vec3(_pick(origin.x, j), _pick(origin.y, j), _pick(origin.z, j))
            d = vec3(_pick(direction.x, j), _pick(direction.y, j), _pick(direction.z, j))
            found[j] = intersect_scalar(surfaces, _pick(k, j), o, d, _pick(t_max, j))
        t = load(found, 0, 0)
        return Intersection(t < INFINITY, t, t * 0.0, t * 0.0)

    return each


@primitive_at.by(ScalarGroup)
@kernel
def _column_at(group, k):
    return ScalarPrimitive(group.column[k], group.surfaces)


@primitives_from.by(ScalarGroup)
@kernel
def _columns_from(group, k):
    return ScalarPrimitive(load_row(group.column, 0, k), group.surfaces)


@intersect.by(ScalarPrimitive)
@kernel
def _intersect(primitive, origin, direction, t_max):
    return _hit(primitive.surfaces, primitive.column, origin, direction, t_max)


@kernel
def points_alone(surfaces, index, mask, hit_point):
    """Return position, normal and shading normal of 16 hit points."""
    rows = local_f32(144)
    bits = mask_bits(mask)
    for j in range(16):
        p = vec3(lane(hit_point.x, j), lane(hit_point.y, j), lane(hit_point.z, j))
        n = vec3(0.0, 0.0, 1.0)
        s, q = n, in_double(p)
        if (bits >> j) & 1 != 0:
            q, n, s = point_alone(surfaces, lane(index, j), p)
        rows[j], rows[16 + j], rows[32 + j] = q.x, q.y, q.z
        rows[48 + j], rows[64 + j], rows[80 + j] = n.x, n.y, n.z
        rows[96 + j], rows[112 + j], rows[128 + j] = s.x, s.y, s.z
    return _three(rows, 0), _three(rows, 48), _three(rows, 96)


@kernel
def _three(rows, first):
    return vec3(
        load_row(rows, 0, first),
        load_row(rows, 0, first + 16),
        load_row(rows, 0, first + 32),
    )


# ------------------------------------------------------------------------------- tables


def matrix_rows(matrices: NDArray[np.float64]) -> Any:
    """Return the upper three rows of matrices (n, 4, 4) and of inverses, (12, n) each."""
    both = (matrices, np.linalg.inv(matrices))
    return (np.ascontiguousarray(m[:, :3].reshape(-1, 12).T) for m in both)


def refuse_lamp(properties: Any, common: dict[str, Any]) -> None:
    """Raise SceneError if the shape has an emitter."""
    if common["radiance"] is not None:
        raise SceneError(
            f"{properties.location}: {properties.element} cannot emit: its area is not "
            "known; a mesh or a sphere can"
        )


def box_corners(lower: Any, upper: Any, to_world: Any) -> NDArray[np.float64]:
    """Return the world space corners (8, 3, n) of boxes (3, n); to_world is (12, n)."""
    ends = np.stack([lower, upper])  # (2, 3, n)
    chosen = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    local = np.stack([ends[chosen[:, axis], axis] for axis in range(3)], axis=1)
    m = to_world.reshape(3, 4, -1)
    return np.einsum("abn,cbn->can", m[:, :3], local) + m[:, 3]


def hull_of_box(corners: NDArray[np.float64]) -> tuple[Any, Any, Any]:
    """Return hulls of boxes (8, 3, n): the centre, and a radius up to the corners."""
    middle = corners.mean(axis=0)
    radius = np.linalg.norm(corners - middle, axis=1).max(axis=0)
    points = np.repeat(middle[:, None], 4, axis=1)
    return points, radius, np.zeros((3, corners.shape[2]), np.float32)
