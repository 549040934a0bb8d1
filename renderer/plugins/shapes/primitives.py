"""Primitives of one kind of shape, in the order of an accelerator, and a ray against one.

What an accelerator asks is resolved by the type of its primitives when it is compiled, so
that it is written once for all kinds of shapes and has no branch for them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, interface, kernel
from renderer.kernels.lanes.fields import lanes_from_rows, one_from_rows


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
    return one_from_rows(group.form, group.rows, 0, k)


@primitives_from.by(Group)
@kernel
def _lanes_of_group(group, k):
    return lanes_from_rows(group.form, group.rows, 0, k)
