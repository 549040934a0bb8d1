"""What the tables of shapes are made with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, by_columns, interface, kernel
from renderer.kernels.lanes.fields import lanes_from_rows, one_from_rows

# The rounding of a hit's t and (u, v) moves it by up to this fraction of the coordinates
# that went into it (32 units in the last place of single precision).
ROUNDING = np.float32(32 * 2.0**-24)


def float32(rows: Any) -> NDArray[np.float32]:
    """Return a C-ordered array in single precision."""
    return np.ascontiguousarray(rows, dtype=np.float32)


def unit_normals(edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return edge1 x edge2 / |edge1 x edge2|, all (3, n).

    In double precision: the square of an area leaves float32 for edges beyond 4e9. What
    has no area has the normal 0; no ray hits it.
    """
    n = np.cross(np.asarray(edge1, np.float64).T, np.asarray(edge2, np.float64).T)
    area = np.linalg.norm(n, axis=1, keepdims=True)
    return float32((n / np.where(area > 0.0, area, 1.0)).T)


def empty_rows(rows: int) -> NDArray[np.float32]:
    """Return a table without columns, for values that the scene does not use."""
    return by_columns(np.zeros((rows, 0)))


def mirrors(matrix: NDArray[np.float64]) -> bool:
    """Return whether a transform turns right hands into left ones."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


# --------------------------------------------------------------------------- primitives
# Primitives of one kind of shape, in the order of an accelerator, and a ray against one.
#
# What an accelerator calls is resolved by the type of its primitives when it is compiled,
# so that it is written once for all kinds of shapes and has no branch for them.


class Intersection(NamedTuple):
    """Where rays meet a primitive; t, u, v mean something only where `hit` is set."""

    hit: Any
    t: Any
    u: Any
    v: Any


class Group(NamedTuple):
    """Primitives in rows; see `kernels.lanes.fields` for how these are laid out."""

    form: Any  # stands for the class of the primitives
    rows: NDArray[np.float32]  # (numbers of a primitive, n), padded by 16 columns of zeros
    id: NDArray[np.int32]  # (n,) primitive id in the scene, padded alike
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

    One primitive and 16 or 8 rays in lanes, or one ray and as many primitives, or both one.
    """


@kernel
def hit_primitive(group, primitive, origin, direction, t_max):
    """Intersect a primitive that came from `group`."""
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
