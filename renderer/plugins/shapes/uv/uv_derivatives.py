"""dp/du and dp/dv at points of shapes: how far apart texels lie, for bumps.

Only scenes with bump maps use them. The tangent of a shading frame, which each bounce
needs, is cheaper and has no meaningful length (`tangent_at`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.affine import affine_of, times
from renderer.kernels.lanes.functions import select, sqrt
from renderer.kernels.lanes.vectors import gather3
from renderer.plugins.shapes.arrays import float32


class ByPrimitive(NamedTuple):
    """Primitives first .. end - 1 by id, whose derivatives are the same everywhere."""

    first: int
    end: int
    along_u: NDArray[np.float32]  # (3, n)
    along_v: NDArray[np.float32]  # (3, n)


class ByPlace(NamedTuple):
    """Shapes first .. end - 1 whose derivatives follow from the local point.

    The maps are laid out as `Placements.to_world` is.
    """

    first: int
    end: int
    surfaces: Any  # the table of the kind, by whose class `uv_axes` is chosen
    to_world: NDArray[np.float32]  # (12 n,)
    to_object: NDArray[np.float32]  # (12 n,)


def no_derivatives(surfaces: Any, shapes: Sequence[Any]) -> ByPrimitive:
    """Return zeros, for kinds without u and v: nothing is displaced there."""
    nothing = np.zeros((3, surfaces.end - surfaces.first), np.float32)
    return ByPrimitive(surfaces.first, surfaces.end, nothing, nothing)


def derivatives_by_place(surfaces: Any, shapes: Sequence[Any]) -> ByPlace:
    """Return the maps to the local points of shapes that have `uv_axes`, and back."""
    maps = np.array([shape.to_world for shape in shapes], float)
    back = np.linalg.inv(maps)
    back[:, :3, 3] = maps[:, :3, 3]
    rows = (
        np.ascontiguousarray(
            np.concatenate([m[:, :3, :3].reshape(-1, 9), m[:, :3, 3]], axis=1).ravel(),
            np.float32,
        )
        for m in (maps, back)
    )
    return ByPlace(surfaces.first, surfaces.end, surfaces, *rows)


def derivatives_of_triangles(triangles: Any, meshes: Sequence[Any]) -> ByPrimitive:
    """Return both derivatives; where u and v span no area, unit vectors, as Mitsuba does.

    Meshes without texture coordinates have those of their barycentric ones.
    """
    ids = triangles.first, triangles.end
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    if not triangles.uvs.size:
        return ByPrimitive(*ids, float32(triangles.edge1), float32(triangles.edge2))
    u0, v0, u1, v1, u2, v2 = triangles.uvs.astype(float)
    area = (u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)
    with np.errstate(all="ignore"):
        along_v = ((u1 - u0) * edge2 - (u2 - u0) * edge1) / area
    _, other = _face_tangents(edge1, edge2)
    along_v = np.where(np.isfinite(along_v).all(axis=0), along_v, other)
    return ByPrimitive(*ids, texture_tangents(triangles), float32(along_v))


def texture_tangents(triangles: Any) -> NDArray[np.float32]:
    """Return dp/du (3, n), not unit; where u and v span no area, of length 1.

    Without texture coordinates u is the first barycentric coordinate.
    """
    uvs = triangles.uvs.astype(np.float64)
    if uvs.shape[1] == 0:
        return float32(triangles.edge1)
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    du1, dv1 = uvs[2] - uvs[0], uvs[3] - uvs[1]
    du2, dv2 = uvs[4] - uvs[0], uvs[5] - uvs[1]
    with np.errstate(all="ignore"):
        along_u = (dv2 * edge1 - dv1 * edge2) / (du1 * dv2 - dv1 * du2)
    there = np.isfinite(along_u).all(axis=0)
    other, _ = _face_tangents(edge1, edge2)
    return np.ascontiguousarray(np.where(there, along_u, other), np.float32)


def _face_tangents(
    edge1: NDArray[np.float64], edge2: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two unit vectors along triangles [Duff2017]; 0 for those without area.

    What Mitsuba takes for dp/du and dp/dv where u and v span no area.
    """
    n = np.cross(edge1, edge2, axis=0)
    length = np.linalg.norm(n, axis=0)
    x, y, z = n / np.where(length > 0.0, length, 1.0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    s = np.array([1.0 + sign * x * x * a, sign * x * y * a, -sign * x])
    t = np.array([x * y * a, sign + y * y * a, -y])
    return s * (length > 0.0), t * (length > 0.0)


@interface
def uv_derivatives(shapes: Any, index: Any, mask: Any, position: Any) -> Any:
    """Return dp/du and dp/dv in the space of the shape, where it is at `position`."""


@interface
def uv_axes(surfaces: Any, q: Any, radius: Any) -> Any:
    """Return dp/du and dp/dv of a shape in its own space, at the local point q.

    `radius` is its distance from the z axis, 1 where that is 0.
    """


@uv_derivatives.by(ByPrimitive)
@kernel
def _by_primitive(shapes, index, mask, position):
    return gather3(shapes.along_u, index, mask), gather3(shapes.along_v, index, mask)


@uv_derivatives.by(ByPlace)
@kernel
def _by_place(shapes, index, mask, position):
    back = affine_of(shapes.to_object, index, mask)
    q = times(back, position - back.at)
    radius = sqrt(q.x * q.x + q.y * q.y)
    out = affine_of(shapes.to_world, index, mask)
    du, dv = uv_axes(shapes.surfaces, q, select(radius > 0.0, radius, 1.0))
    return times(out, du), times(out, dv)
