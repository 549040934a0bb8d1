"""Transforms of the scene file as 4x4 matrices that act on column vectors.

The steps of `<transform>` are in the order of their application, so each new step is
multiplied from the left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
_SMALLEST = 1e-38  # smallest length of a column: the largest float32 is 3.4e38
_SINGULAR = 1e-12  # smallest |det|, relative to the product of the column lengths
_UNIT = 1e-2  # tolerance of an axis's length, for axes like "0.577 0.577 0.577"


def translate(x: float, y: float, z: float) -> Matrix:
    """Return the translation by (x, y, z)."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scale(x: float, y: float, z: float) -> Matrix:
    """Return the scaling by (x, y, z)."""
    return np.diag([x, y, z, 1.0])


def rotate(axis: Sequence[float], degrees: float) -> Matrix:
    """Return the rotation about `axis`, counter-clockwise against it.

    Parameters
    ----------
    axis
        Of length 1. It is not normalised, and any other length gives no rotation, as in
        Mitsuba.
    """
    vector = np.asarray(axis, dtype=np.float64)
    angle = math.radians(degrees)
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)  # Rodrigues' formula
    matrix[:3, :3] = (
        math.cos(angle) * np.eye(3)
        + math.sin(angle) * cross
        + (1.0 - math.cos(angle)) * np.outer(vector, vector)
    )
    return matrix


def why_distorting(axis: Sequence[float]) -> str | None:
    """Return the effect of a rotation's axis without unit length, or None."""
    length = math.hypot(*axis)
    if abs(length - 1.0) <= _UNIT:
        return None
    return (
        f"has the length {length:.4g}; Mitsuba does not normalize it, so this distorts "
        "(and does here too); write an axis of length 1"
    )


def look_at(
    origin: Sequence[float], target: Sequence[float], up: Sequence[float] | None
) -> Matrix | None:
    """Return world_from_camera for a camera at `origin` that looks along +z at `target`.

    +y points as near to `up` as it can and +x to the *left*, which keeps the frame
    right-handed. None if `target` is `origin` or `up` is parallel to the view.

    Parameters
    ----------
    up
        None: any direction that is not parallel to the view (Mitsuba does not specify it).
    """
    with np.errstate(all="ignore"):
        position = np.asarray(origin, dtype=np.float64)
        direction = np.asarray(target, dtype=np.float64) - position
        direction = direction / np.linalg.norm(direction)
        if up is None:
            upward = _perpendicular(direction)
        else:
            upward = np.asarray(up, dtype=np.float64)
            upward = upward / np.linalg.norm(upward)
        left = _cross(upward, direction)
        length = np.linalg.norm(left)
        left = left / length
    if not (np.isfinite(left).all() and length > 1e-12):
        return None
    matrix = np.eye(4)
    matrix[:3, 0] = left
    matrix[:3, 1] = _cross(direction, left)
    matrix[:3, 2] = direction
    matrix[:3, 3] = position
    return matrix


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a x b; `np.cross`, made for many vectors, takes ten times as long for two."""
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _perpendicular(n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first tangent of Duff et al. 2017, the basis that Mitsuba uses."""
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return np.array([1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]])


def z_to(direction: Sequence[float]) -> Matrix:
    """Return a rotation that takes +z to `direction` (any length but 0)."""
    n = np.asarray(direction, dtype=np.float64)
    n = n / np.linalg.norm(n)
    tangent = _perpendicular(n)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = tangent, np.cross(n, tangent), n
    return matrix


def place_points(matrix: Matrix, points: NDArray[Any]) -> NDArray[np.float32]:
    """Return points (n, 3) under an affine transform, rounded as in Mitsuba.

    Mitsuba uses single precision with fused multiply-adds; products are exact in float64.
    All 7951 vertices of the meshes in scenes/ are equal bit by bit; in float64 throughout
    2005 are. A replay needs them where the sign of a rounding error decides something, such
    as the frame on a wall.
    """
    columns = np.asarray(matrix, np.float64).astype(np.float32)[:3].T
    x, y, z = np.asarray(points).astype(np.float32).T[:, :, None]
    placed = np.broadcast_to(columns[3], (len(points), 3))
    for column, coordinate in zip(columns, (x, y, z), strict=False):
        placed = _multiply_add(column, coordinate, placed)
    return placed


def place_normals(matrix: Matrix, normals: NDArray[Any]) -> NDArray[np.float32]:
    """Return unit normals (n, 3) under an affine transform, rounded as in Mitsuba.

    The inverse transpose is computed in double precision and rounded once. Squares are
    summed as in four lanes, x and z first. The normals in files of scenes/ are equal bit by
    bit; in float64 throughout 2 of 5 components are not. For extreme transforms squares may
    overflow or underflow single precision: NaN or 0.
    """
    with np.errstate(over="ignore"):
        columns = np.linalg.inv(matrix[:3, :3]).astype(np.float32)  # of the transpose
    x, y, z = np.asarray(normals).astype(np.float32).T[:, :, None]
    with np.errstate(all="ignore"):
        turned = _multiply_add(columns[2], z, _multiply_add(columns[1], y, columns[0] * x))
        squares = turned * turned
        length2 = (squares[:, 0] + squares[:, 2]) + squares[:, 1]
        return turned * (np.float32(1.0) / np.sqrt(length2))[:, None]


def _multiply_add(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[np.float32]:
    """Return a b + c in float32, rounded once (except ties: it is computed in float64)."""
    return (np.multiply(a, b, dtype=np.float64) + c).astype(np.float32)


def why_unusable(matrix: Matrix) -> str | None:
    """Return what is wrong with an affine (4, 4) transform, or None if nothing is."""
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > np.finfo(np.float32).max:
        return "it is not finite"
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        return "its last row is not 0 0 0 1 (only affine transforms are possible)"
    if is_singular(matrix[:3, :3]):
        return "it is singular (it flattens space, so it has no inverse)"
    if column_lengths(matrix).min() < _SMALLEST:
        return (
            f"it shrinks to less than {_SMALLEST:g}, whose inverse leaves single precision"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        inverse = np.linalg.inv(matrix)
    if not np.abs(inverse).max() <= np.finfo(np.float32).max:
        return "its inverse leaves single precision (it shrinks or shears too much)"
    return None


def is_singular(linear: NDArray[np.float64]) -> bool:
    """Return whether a square matrix is singular, independent of its scale."""
    lengths = np.linalg.norm(linear, axis=0)
    if not (lengths > 0.0).all():
        return True
    return bool(abs(np.linalg.det(linear / lengths)) <= _SINGULAR)


def uv_part(matrix: Matrix) -> NDArray[np.float64]:
    """Return the (3, 3) transform of (u, v, 1) from the x and y of a (4, 4) one."""
    rows = np.ix_((0, 1, 3), (0, 1, 3))
    return np.ascontiguousarray(matrix[rows])


def column_lengths(matrix: Matrix) -> NDArray[np.float64]:
    """Return the scale factors along the three axes."""
    lengths: NDArray[np.float64] = np.linalg.norm(matrix[:3, :3], axis=0)
    return lengths


def has_shear(matrix: Matrix, tolerance: float = 1e-4) -> bool:
    """Return whether the transformed axes are not perpendicular to each other."""
    unit = matrix[:3, :3] / column_lengths(matrix)
    return bool(np.abs(unit.T @ unit - np.eye(3)).max() > tolerance)


def mirrors(matrix: Matrix) -> bool:
    """Return whether right-handed frames become left-handed."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)
