"""Intersection of one primitive, groups of primitives, and array helpers of the tables."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, by_columns, interface, kernel
from renderer.kernels.lanes.fields import lanes_from_rows, one_from_rows

# Rounding of t and (u, v) moves a hit by at most this fraction of the coordinates that it
# is computed from (32 units of 2^-24).
ROUNDING = np.float32(32 * 2.0**-24)


def float32(rows: Any) -> NDArray[np.float32]:
    """Return a C-ordered array in single precision."""
    return np.ascontiguousarray(rows, dtype=np.float32)


def unit_normals(edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return edge1 x edge2 / |edge1 x edge2|, all (3, n).

    Computed in double precision: for edges beyond 4e9 the squared area overflows float32.
    A primitive without area has the normal 0; no ray hits it.
    """
    n = np.cross(np.asarray(edge1, np.float64).T, np.asarray(edge2, np.float64).T)
    area = np.linalg.norm(n, axis=1, keepdims=True)
    return float32((n / np.where(area > 0.0, area, 1.0)).T)


def empty_rows(rows: int) -> NDArray[np.float32]:
    """Return a table without columns, for attributes that the scene does not use."""
    return by_columns(np.zeros((rows, 0)))


def mirrors(matrix: NDArray[np.float64]) -> bool:
    """Return whether a transform changes handedness (negative determinant)."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


# --------------------------------------------------------------------------- primitives
# Primitives of one kind of shape in the order of an accelerator, and their ray test.
#
# An accelerator calls interfaces that are resolved by the type of its primitives at compile
# time. So it is written once for all kinds of shape, without a branch for each.


class Intersection(NamedTuple):
    """Result of a ray-primitive test; t, u, v are valid only where `hit` is set."""

    hit: Any
    t: Any
    u: Any
    v: Any


class Group(NamedTuple):
    """Primitives in rows, laid out as described in `kernels.lanes.fields`."""

    form: Any  # record whose type selects the class of the primitives
    rows: NDArray[np.float32]  # (numbers of a primitive, n), padded by 16 columns of zeros
    id: NDArray[np.int32]  # (n,) primitive id in the scene, with the same padding
    count: int  # n without the padding


@interface
def primitive_at(group: Any, k: int) -> Any:
    """Return primitive k of a group as scalars."""


@interface
def primitives_from(group: Any, k: int) -> Any:
    """Return primitives k to k + 15 of a group as lanes."""


@interface
def intersect(primitive: Any, origin: Any, direction: Any, t_max: Any) -> Any:
    """Return the `Intersection` with 0 < t <= t_max.

    Either one primitive and 16 or 8 rays in lanes, or one ray and 16 or 8 primitives in
    lanes, or one ray and one primitive.
    """


@kernel
def hit_primitive(group, primitive, origin, direction, t_max):
    """Intersect rays with a primitive that was loaded from `group`."""
    always_inline()
    return intersect(primitive, origin, direction, t_max)


@primitive_at.by(Group)
@kernel
def _one_of_group(group, k):
    return one_from_rows(group.form, group.rows, None, 0, k)


@primitives_from.by(Group)
@kernel
def _lanes_of_group(group, k):
    return lanes_from_rows(group.form, group.rows, None, 0, k)
