"""Hits in Mitsuba's arithmetic: the interface for shapes, and the matrices of instances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces
from renderer.scene_file.description import Instance

# -------------------------------------------------------------------- instance matrices
# The matrices by which Embree and Mitsuba transform rays into an instance.
#
# Our own (`renderer.scene.placed_groups`) undo the translation first, which is more
# accurate but not the same.

Columns = NDArray[np.float32]  # (3, n)


def instance_matrices(instances: Sequence[Instance]) -> NDArray[np.float32]:
    """Return the matrices of all instances, (24, n).

    Rows 0 to 11 are Embree's inverse: its columns, then the image of the origin. Rows 12 to
    23 are Mitsuba's inverse, whose columns are the rows of the normal matrix.
    """
    if not instances:
        return np.zeros((24, 0), np.float32)
    matrices = np.array([instance.to_world for instance in instances])
    mitsuba = np.linalg.inv(matrices)[:, :3].transpose(2, 1, 0).reshape(12, -1)
    with np.errstate(all="ignore"):  # tiny instances: a non-finite matrix rounds nothing
        embree = _embree_inverse(matrices[:, :3].astype(np.float32))
        return np.concatenate([embree, mitsuba.astype(np.float32)])


def _embree_inverse(matrices: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the inverse of (n, 3, 4), with instructions that every x86-64 processor has.

    Nothing is fused, and the cofactors are divided by the determinant. This was found by
    trial with Mitsuba's Embree 3.
    """
    x, y, z, at = matrices.transpose(2, 1, 0)  # columns, each (3, n)
    rows = np.array([_cross(y, z), _cross(z, x), _cross(x, y)])
    product = x * rows[0]
    rows = rows / ((product[0] + product[1]) + product[2])
    columns = rows.transpose(1, 0, 2)
    moved = at[0] * columns[0] + (at[1] * columns[1] + at[2] * columns[2])
    return np.concatenate([columns.reshape(9, -1), -moved])


def _cross(a: Columns, b: Columns) -> Columns:
    return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]


# ------------------------------------------------------------------ triangle arithmetic
# Mitsuba's single-precision arithmetic on triangles, with the same rounding.
#
# Its x86 builds use fused multiply-adds where ours never do. Most results then differ by a
# rounding that a replay tolerates; two may not. The cumulative areas of a mesh light decide
# which triangle a random number chooses and where in it. The sign of a zero decides the
# frame on a wall. The areas below agreed with Mitsuba bit for bit.


def product_difference(a: Any, b: Any, c: Any) -> Any:
    """Return a b - c of float32; rounded once (through float64) except for ties."""
    return (np.multiply(a, b, dtype=np.float64) - c).astype(np.float32)


def cross(a: Columns, b: Columns) -> Columns:
    """Return a x b; in each component the second product is rounded first."""
    return np.array(
        [
            product_difference(a[1], b[2], a[2] * b[1]),
            product_difference(a[2], b[0], a[0] * b[2]),
            product_difference(a[0], b[1], a[1] * b[0]),
        ]
    )


def squared_length(a: Columns) -> Any:
    """Return |a|^2, summed as in four lanes: first x and z, then y."""
    return (a[0] * a[0] + a[2] * a[2]) + a[1] * a[1]


def triangle_areas(edge1: Columns, edge2: Columns) -> Any:
    """Return the areas (n,) of triangles, float32."""
    return np.float32(0.5) * np.sqrt(squared_length(cross(edge1, edge2)))


def face_normals(edge1: Columns, edge2: Columns) -> Columns:
    """Return the unit normals (3, n) of triangles, before `flip_normals`."""
    normal = cross(edge1, edge2)
    with np.errstate(all="ignore"):
        return normal * (np.float32(1.0) / np.sqrt(squared_length(normal)))


def first_tangents(normal: Columns) -> Columns:
    """Return the first of two vectors that complete unit normals to a frame [Duff2017]."""
    x, y, z = normal
    sign = np.copysign(np.float32(1.0), z)
    a = -np.float32(1.0) / (sign + z)
    return np.array([sign * (x * x * a) + np.float32(1.0), sign * (x * y * a), -sign * x])


def triangle_tangents(triangles: TriangleSurfaces) -> Columns:
    """Return dp/du (3, n) of triangles in object space, not unit, whatever the flips."""
    return uv_tangents(triangles.edge1, triangles.edge2, triangles.uvs)


def uv_tangents(edge1: Columns, edge2: Columns, uvs: NDArray[np.float32]) -> Columns:
    """Return dp/du (3, n) from edges and the texture coordinates (6, n) of the vertices.

    Meshes without texture coordinates use barycentric ones, so dp/du is edge1. If u and v
    are degenerate it is the first tangent of the geometric normal.
    """
    du1, dv1 = uvs[2] - uvs[0], uvs[3] - uvs[1]
    du2, dv2 = uvs[4] - uvs[0], uvs[5] - uvs[1]
    determinant = product_difference(du1, dv2, dv1 * du2)
    with np.errstate(all="ignore"):
        along_u = product_difference(dv2, edge1, dv1 * edge2) * (
            np.float32(1.0) / determinant
        )
    other = first_tangents(face_normals(edge1, edge2))
    return np.ascontiguousarray(np.where(determinant != 0.0, along_u, other))


# --------------------------------------------------------------------------- exact hits
# For each kind of shape: its numbers as Mitsuba stores them, and its hits.
#
# Hits of a kind that is not in `EXACT` keep the renderer's rounding.


class HitPoint(NamedTuple):
    """A hit with Mitsuba's rounding, as scalars."""

    position: Any
    normal: Any  # geometric, unit, before flips: outwards on a curved surface
    vertex_normal: Any  # interpolated, unit; the geometric one without vertex normals
    tangent: Any  # dp/du
    u: Any = None  # texture coordinates; None: keep the renderer's
    v: Any = None


# record class of a table -> function (table, its shapes) -> record of `exact_hit`
EXACT: dict[type, Callable[[Any, Sequence[Any]], Any]] = {}


@interface
def exact_hit(
    shapes: Any, k: int, u: Any, v: Any, probe: Any, ray: Any, grouped: Any
) -> HitPoint:
    """Return the hit on primitive k with Mitsuba's rounding.

    Parameters
    ----------
    u, v
        The hit's coordinates on the primitive.
    probe, ray
        t is found with `probe`, and the hit is at that t of `ray`. They differ only inside
        instances (`hits.py`).
    grouped
        Whether the primitive is in a group.
    """


def both_matrices(shapes: Sequence[Any]) -> NDArray[np.float32]:
    """Return the rows of to_world, then of its inverse, (24, n)."""
    matrices = np.array([shape.to_world for shape in shapes])
    both = np.stack([matrices, np.linalg.inv(matrices)], axis=1)[:, :, :3]
    return np.ascontiguousarray(both.reshape(-1, 24).T, np.float32)
