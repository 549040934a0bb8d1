"""What a replay knows of a kind of shape: its numbers as Mitsuba stores them, and hits.

A kind that is not in `EXACT` keeps the roundings of the renderer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface


class HitPoint(NamedTuple):
    """What Mitsuba knows of a hit, as scalars."""

    position: Any
    normal: Any  # geometric, unit, before any flip: outwards of a curved surface
    vertex_normal: Any  # interpolated, unit; the geometric one where there are none
    tangent: Any  # dp/du
    u: Any = None  # texture coordinates; None: those of the renderer stay
    v: Any = None


# class of a table of shapes -> (table, its shapes) -> the record of `exact_hit`
EXACT: dict[type, Callable[[Any, Sequence[Any]], Any]] = {}


@interface
def exact_hit(
    shapes: Any, k: int, u: Any, v: Any, probe: Any, ray: Any, grouped: Any
) -> HitPoint:
    """Return the hit on primitive k as Mitsuba rounds it.

    Parameters
    ----------
    u, v
        The primitive's own coordinates of the hit.
    probe, ray
        `probe` finds t, and `ray` is followed to it. They are the same but inside of
        instances (`instance_space`).
    grouped
        Whether the primitive is in a group.
    """


def both_matrices(shapes: Sequence[Any]) -> NDArray[np.float32]:
    """Return the rows of to_world, then of its inverse, (24, n)."""
    matrices = np.array([shape.to_world for shape in shapes])
    both = np.stack([matrices, np.linalg.inv(matrices)], axis=1)[:, :, :3]
    return np.ascontiguousarray(both.reshape(-1, 24).T, np.float32)
