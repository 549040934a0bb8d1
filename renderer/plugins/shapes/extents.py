"""Boxes and hulls of primitives: the input of every builder of an accelerator.

A builder reads no triangles or spheres, only their boxes and hulls. So each accelerator
supports every kind of primitive.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.primitives import ROUNDING as ROUNDING
from renderer.plugins.shapes.registry import SHAPES
from renderer.process.worker_pool import in_parts

# column numbers (n,), perhaps repeated -> the group of those primitives, in that order
PrimitiveGroup = Callable[[NDArray[np.int64]], Any]


class Hulls(NamedTuple):
    """See the properties of `Extents`."""

    points: NDArray[np.float32]
    radius: NDArray[np.float32]
    normal: NDArray[np.float32]


def primitive_bounds(
    kind: str, surfaces: Any
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return lower and upper corners, (3, n) each, of a kind's primitives."""
    if (boxes := SHAPES[kind].boxes) is not None:
        return boxes(surfaces)
    points = SHAPES[kind].corners(surfaces)
    lower = np.minimum.reduce(points)
    upper = np.maximum.reduce(points)
    # the sums above and the hit test round differently: pad by the largest rounding error
    slack = ROUNDING * np.maximum(np.abs(lower), np.abs(upper)).max(axis=0)
    return (lower - slack).astype(np.float32), (upper + slack).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Extents:
    """Boxes and hulls of n primitives, and the distance by which rounding widens them."""

    lower: NDArray[np.float32]  # (3, n) smallest x, y, z
    upper: NDArray[np.float32]  # (3, n) largest x, y, z
    # A ray that starts at |x| + |y| + |z| <= reach may hit a primitive up to `pad` outside
    # of its box. Grids pad boxes and hulls by this, and test rays from farther away against
    # all primitives.
    reach: float
    pad: float
    make_hulls: Callable[[], Hulls]  # called on first use: a BVH needs no hulls

    @functools.cached_property
    def _hulls(self) -> Hulls:
        return self.make_hulls()

    @property
    def points(self) -> NDArray[np.float32]:
        """(3, 4, n): a primitive lies in the hull of its 4 points, grown by `radius`."""
        return self._hulls.points

    @property
    def radius(self) -> NDArray[np.float32]:
        """(n,) by which the convex hull of `points` is grown."""
        return self._hulls.radius

    @property
    def normal(self) -> NDArray[np.float32]:
        """(3, n) unit normal of the plane of a flat primitive; 0 if it is not flat."""
        return self._hulls.normal


def extents_of(
    kind: str, surfaces: Any, order: NDArray[np.int64], reach: float = 0.0
) -> Extents:
    """Return the extents of some primitives of one kind of shape.

    Parameters
    ----------
    kind
        Name of the kind, a key of `renderer.plugins.shapes.registry.SHAPES`.
    surfaces
        Table of that kind's primitives.
    order
        Columns of the record, (n,).
    reach
        Rays that start within this sum of absolute coordinates shall be fast; the box
        of the primitives is always included.
    """
    lower, upper = primitive_bounds(kind, surfaces)
    if not np.array_equal(order, np.arange(lower.shape[1])):
        lower, upper = (np.ascontiguousarray(side[:, order]) for side in (lower, upper))

    def largest(begin: int, end: int) -> NDArray[np.float32]:
        return np.maximum(np.abs(lower[:, begin:end]), np.abs(upper[:, begin:end]))

    farthest = in_parts(len(order), lambda *part: largest(*part).sum(axis=0).max())
    reach = max(reach, *map(float, farthest), 0.0)
    reach = float(np.float32(reach * 1.000001))  # kernels sum |x| + |y| + |z| in float32

    def make_hulls() -> Hulls:
        points, radius, normal = SHAPES[kind].hull(surfaces, order)
        return Hulls(
            np.ascontiguousarray(points, np.float32),
            (radius + ROUNDING * largest(0, len(order)).max(axis=0)).astype(np.float32),
            np.ascontiguousarray(normal, np.float32),
        )

    return Extents(lower, upper, reach, float(ROUNDING) * reach, make_hulls)
