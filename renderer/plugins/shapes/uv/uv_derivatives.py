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
from renderer.kernels.lanes.functions import select, splat_f32, sqrt
from renderer.kernels.lanes.vectors import gather3, vec3
from renderer.plugins.sampling.numbers_and_warps import TWO_PI
from renderer.plugins.shapes.arrays import float32
from renderer.plugins.shapes.flat.triangle import TriangleSurfaces

_PI = np.float32(np.pi)


class Flat(NamedTuple):
    """Triangles or rectangles first .. end - 1 by primitive id."""

    first: int
    end: int
    along_u: NDArray[np.float32]  # (3, n)
    along_v: NDArray[np.float32]  # (3, n)


class RoundDisks(NamedTuple):
    """Disks; the maps are laid out as `Placements.to_world` is."""

    first: int
    end: int
    to_world: NDArray[np.float32]  # (12 n,)
    to_object: NDArray[np.float32]  # (12 n,)


class RoundSpheres(NamedTuple):
    """Spheres, as `RoundDisks`."""

    first: int
    end: int
    to_world: NDArray[np.float32]
    to_object: NDArray[np.float32]


class RoundCylinders(NamedTuple):
    """Cylinders, as `RoundDisks`."""

    first: int
    end: int
    to_world: NDArray[np.float32]
    to_object: NDArray[np.float32]


_ROUND = {"disks": RoundDisks, "spheres": RoundSpheres, "cylinders": RoundCylinders}


def derivatives_of(kind: str, surfaces: Any, shapes: Sequence[Any]) -> Any:
    """Return the record of a kind; `shapes` are all of it, in their order."""
    if kind == "triangles":
        return Flat(surfaces.first, surfaces.end, *_of_triangles(surfaces))
    if kind not in ("rectangles", *_ROUND):  # no u, no v: nothing is displaced there
        nothing = np.zeros((3, surfaces.end - surfaces.first), np.float32)
        return Flat(surfaces.first, surfaces.end, nothing, nothing)
    maps = np.array([shape.to_world for shape in shapes], float)
    if kind == "rectangles":  # u and v go from 0 to 1 along edges of length 2
        columns = (np.ascontiguousarray(2.0 * maps[:, :3, k].T, np.float32) for k in (0, 1))
        return Flat(surfaces.first, surfaces.end, *columns)
    back = np.linalg.inv(maps)
    back[:, :3, 3] = maps[:, :3, 3]
    rows = (
        np.ascontiguousarray(
            np.concatenate([m[:, :3, :3].reshape(-1, 9), m[:, :3, 3]], axis=1).ravel(),
            np.float32,
        )
        for m in (maps, back)
    )
    return _ROUND[kind](surfaces.first, surfaces.end, *rows)


def _of_triangles(triangles: TriangleSurfaces) -> tuple[Any, Any]:
    """Return both derivatives; where u and v span no area, unit vectors, as Mitsuba does.

    Meshes without texture coordinates have those of their barycentric ones.
    """
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    if not triangles.uvs.size:
        return float32(triangles.edge1), float32(triangles.edge2)
    u0, v0, u1, v1, u2, v2 = triangles.uvs.astype(float)
    area = (u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)
    with np.errstate(all="ignore"):
        along_v = ((u1 - u0) * edge2 - (u2 - u0) * edge1) / area
    _, other = _face_tangents(edge1, edge2)
    along_v = np.where(np.isfinite(along_v).all(axis=0), along_v, other)
    return texture_tangents(triangles), np.ascontiguousarray(along_v, np.float32)


def texture_tangents(triangles: TriangleSurfaces) -> NDArray[np.float32]:
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


@uv_derivatives.by(Flat)
@kernel
def _on_flat(shapes, index, mask, position):
    return gather3(shapes.along_u, index, mask), gather3(shapes.along_v, index, mask)


@kernel
def _maps(shapes, index, mask, position):
    """Return the map to the world, the local point and its distance from the axis."""
    back = affine_of(shapes.to_object, index, mask)
    q = times(back, position - back.at)
    radius = sqrt(q.x * q.x + q.y * q.y)
    return affine_of(shapes.to_world, index, mask), q, select(radius > 0.0, radius, 1.0)


@uv_derivatives.by(RoundDisks)
@kernel
def _on_disks(shapes, index, mask, position):
    out, q, radius = _maps(shapes, index, mask, position)
    none = splat_f32(0.0)
    outwards = vec3(q.x / radius, q.y / radius, none)
    return times(out, outwards), times(out, vec3(-q.y, q.x, none) * TWO_PI)


@uv_derivatives.by(RoundSpheres)
@kernel
def _on_spheres(shapes, index, mask, position):
    out, q, radius = _maps(shapes, index, mask, position)
    down = vec3(q.z * q.x / radius, q.z * q.y / radius, -radius)
    around = vec3(-q.y, q.x, splat_f32(0.0))
    return times(out, around * TWO_PI), times(out, down * _PI)


@uv_derivatives.by(RoundCylinders)
@kernel
def _on_cylinders(shapes, index, mask, position):
    out, q, _ = _maps(shapes, index, mask, position)
    none = splat_f32(0.0)
    around = vec3(-q.y, q.x, none)
    return times(out, around * TWO_PI), times(out, vec3(none, none, splat_f32(1.0)))
