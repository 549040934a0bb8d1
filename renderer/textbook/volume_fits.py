"""Fits of bounding volumes to points: balls, boxes, slabs, polytopes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.plugins.shapes.extents import ROUNDING, Extents
from renderer.textbook.bounding_volumes import DIAGONAL, Aabb, BoundingSphere, Slabs
from renderer.textbook.box_axes import GrownPoints, box_axes

# ------------------------------------------------------------------------ smallest ball
# The smallest ball that encloses balls [Gaertner1999] [Fischer2003].
#
# At most four balls touch the smallest one and determine it. Start with two that are far
# apart, as Ritter does [Ritter1990]. While a ball is not enclosed, add the one that sticks
# out most, and solve the problem of at most five balls by trying every subset. The radius
# grows in each round, so no set of four occurs twice and the loop ends. It takes 5 to 15
# rounds, each one pass over the balls. (Welzl's recursion is right for points only, not for
# balls.)

MOST_ROUNDS = 200  # far above the 15 seen; fits compute their radius from the centre
# Bound of rounding errors of a radius in double precision, relative to the size.
TOLERANCE = 1e-12


def smallest_ball(
    centers: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the centre (3,) of the smallest ball around balls (3, n), (n,), n >= 1."""
    middle = centers.mean(axis=1)
    balls = np.vstack((centers - middle[:, None], radii))  # (4, n)
    size = float(np.abs(balls).max())
    first = _farthest(balls, np.zeros(3))[0]
    members = [first, _farthest(balls, balls[:3, first])[0]]
    center, radius, members = _smallest_of_few(balls, members, size)
    for _ in range(MOST_ROUNDS):
        outside, reach = _farthest(balls, center)
        if reach <= radius + TOLERANCE * size:
            break
        found = _smallest_of_few(balls, [*members, outside], size)
        if found[1] <= radius:  # only rounding is left to gain
            break
        center, radius, members = found
    return center + middle


def _farthest(balls: NDArray[np.float64], center: NDArray[np.float64]) -> tuple[int, float]:
    """Return the ball whose far side is farthest from a point, and that distance."""
    reach = np.linalg.norm(balls[:3] - center[:, None], axis=0) + balls[3]
    index = int(reach.argmax())
    return index, float(reach[index])


def _smallest_of_few(balls: Any, members: list[int], size: float) -> Any:
    """Return (centre, radius, members that touch it) of the smallest ball around a few.

    Some subset touches it from inside, and its centre is in the subset's affine hull. Of
    all such balls that enclose the rest it is the smallest.
    """
    few = balls[:, members]
    best: Any = (few[:3].mean(axis=1), np.inf, members)
    for count in range(1, min(4, len(members)) + 1):
        for chosen in combinations(range(len(members)), count):
            for center, radius in _touching(few[:, chosen]):
                _, reach = _farthest(few, center)
                if reach <= radius + TOLERANCE * size and radius < best[1]:
                    best = center, radius, [members[k] for k in chosen]
    return best


def _touching(balls: Any) -> list[tuple[Any, float]]:
    """Return the balls (at most two) that m balls touch from inside.

    With x the centre relative to ball 0 and q_i ball i relative to it, |x| = R - r_0 and
    |x - q_i| = R - r_i. The difference of their squares is linear in x and R,

        q_i . x = (|q_i|^2 + r_0^2 - r_i^2) / 2 + R (r_i - r_0),

    so x = u + R v. Inserted into the first equation that gives a quadratic equation for R.
    """
    p, r = balls[:3, 0], balls[3]
    if len(r) == 1:
        return [(p, float(r[0]))]
    q = (balls[:3, 1:] - p[:, None]).T
    given = (np.sum(q * q, axis=1) + r[0] ** 2 - r[1:] ** 2) / 2.0
    u, v = np.linalg.lstsq(q, np.column_stack((given, r[1:] - r[0])), rcond=None)[0].T
    a, b, c = v @ v - 1.0, u @ v + r[0], u @ u - r[0] ** 2
    root = np.sqrt(max(b * b - a * c, 0.0))
    s = -(b + root) if b > 0.0 else root - b
    radii = [top / below for top, below in ((s, a), (c, s)) if below != 0.0]
    return [(p + u + R * v, float(R)) for R in radii if r.max() <= R < np.inf]


# ----------------------------------------------------------------------------- polytope
# The surface area of an intersection of slabs: each face is cut out of its plane.
#
# A large square in the plane is clipped by all other half-spaces [Sutherland1974]. That
# needs no vertex enumeration and works for degenerate volumes: flat, a line, a point.

Polygon = NDArray[np.float64]  # (m, 3)


def polytope_area(
    normals: NDArray[np.float64], lower: ArrayLike, upper: ArrayLike
) -> float:
    """Return the surface area of { x : lower <= normals x <= upper }.

    Parameters
    ----------
    normals
        (s, 3), of any length; the first three are orthogonal to each other and bound it.
    lower, upper
        (s,), lower <= upper.
    """
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    # relative to the middle of the box, so that distant volumes lose no digits
    middle = np.linalg.solve(normals[:3], (low[:3] + high[:3]) / 2.0)
    shift = normals @ middle
    size = 2.0 * float(np.linalg.norm(high[:3] - low[:3]))
    planes = np.concatenate((normals, -normals))
    offsets = np.concatenate((high - shift, shift - low))
    return sum(_face_area(planes, offsets, k, size) for k in range(len(planes)))


def _face_area(
    planes: NDArray[np.float64], offsets: NDArray[np.float64], face: int, size: float
) -> float:
    """Return the area of the part of plane `face` that is behind all others."""
    slabs = len(planes) // 2
    polygon = _square(planes[face], offsets[face], size)
    for other in range(len(planes)):
        if other % slabs == face % slabs:  # itself, or the other side of its slab
            continue
        polygon = _clipped(polygon, planes[other], offsets[other])
        if len(polygon) < 3:
            return 0.0
    fans = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])
    return float(np.linalg.norm(fans.sum(axis=0))) / 2.0


def _square(normal: NDArray[np.float64], offset: float, size: float) -> Polygon:
    """Return a square in the plane normal . x = offset that contains the whole face."""
    n = normal / np.linalg.norm(normal)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    center = normal * (offset / (normal @ normal))
    return center + size * np.array([u + v, v - u, -u - v, u - v])


def _clipped(polygon: Polygon, normal: NDArray[np.float64], offset: float) -> Polygon:
    """Return the part of a convex polygon with normal . x <= offset."""
    depth = offset - polygon @ normal
    kept = []
    for k in range(len(polygon)):
        a, b = depth[k - 1], depth[k]
        if (a >= 0.0) != (b >= 0.0):
            kept.append(polygon[k - 1] + (polygon[k] - polygon[k - 1]) * (a / (a - b)))
        if b >= 0.0:
            kept.append(polygon[k])
    return np.array(kept).reshape(-1, 3)


# -------------------------------------------------------------------------- volume fits
# Bounding volumes fitted to points: small, and enclosing all points.
#
# Points are grown by radii, so that their hull covers every kind of primitive. Fitting is
# done in double precision; the result is stored in single, rounded away from the points.
#
# The quality of a volume is the fraction of random rays that hit it. By Cauchy's formula
# the mean projected area of a convex body is a quarter of its surface area. So of the lines
# that hit a convex body, the fraction that hits a convex body inside it is the ratio of the
# two surface areas, which is computed here exactly.

# Normals of the slabs of a k-DOP; k directions are k / 2 slabs. 6: the axes, a box. 10: and
# two diagonals of the faces across one axis, a box with four bevelled edges. 14: the axes
# and the four diagonals of a cube, a box with bevelled corners, as used by Kay and Kajiya.
# Integers, not unit vectors: products with them are exact.
_AXES = np.eye(3)
_CORNERS = np.array([[1.0, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]])
_BEVELS = (  # edges along x, y, z
    np.array([[0.0, 1, 1], [0, 1, -1]]),
    np.array([[1.0, 0, 1], [1, 0, -1]]),
    np.array([[1.0, 1, 0], [1, -1, 0]]),
)
ORIENTATIONS = {
    6: (_AXES,),
    10: tuple(np.concatenate((_AXES, bevel)) for bevel in _BEVELS),
    14: (np.concatenate((_AXES, _CORNERS)),),
}


class Volume(NamedTuple):
    """The operations of one kind of volume outside of kernels."""

    fit: Callable[..., Any]  # (points (3, n), radius (n,) or a number) -> record
    area: Callable[[Any], float]  # surface area of a record; a flat volume has two sides
    contains: Callable[..., NDArray[np.bool_]]  # (record, points, radius) -> (n,)


def grown_points(points: ArrayLike, radius: ArrayLike = 0.0) -> GrownPoints:
    """Check and convert the points to which a volume is fitted.

    Parameters
    ----------
    points
        (3, n), n >= 1, finite.
    radius
        (n,) or one number for all, >= 0 and finite.

    Raises
    ------
    ValueError
        Otherwise.
    """
    center = np.asarray(points, np.float64)
    if center.ndim != 2 or center.shape[0] != 3 or center.shape[1] == 0:
        raise ValueError(f"a volume needs points (3, n), n >= 1, not {center.shape}")
    radii = np.broadcast_to(np.asarray(radius, np.float64), center.shape[1:])
    if not (np.isfinite(center).all() and np.isfinite(radii).all()):
        raise ValueError("a volume needs finite points and radii")
    if (radii < 0.0).any():
        raise ValueError(f"radius {radii.min()} is negative")
    largest = float((np.abs(center) + radii).max())
    return GrownPoints(center, radii, float(ROUNDING) * largest)


def points_of_extents(extents: Extents) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return (points (3, 4 n), radius (4 n,)) of primitives, for any of the fits."""
    return extents.points.reshape(3, -1), np.tile(extents.radius, 4)


def rounded_up(values: ArrayLike) -> Any:
    """Return the smallest float32 that are not below the values."""
    exact = np.asarray(values, np.float64)
    near = exact.astype(np.float32)
    return np.where(near < exact, np.nextafter(near, np.float32(np.inf)), near)


def rounded_down(values: ArrayLike) -> Any:
    """Return the largest float32 that are not above the values."""
    return -rounded_up(-np.asarray(values, np.float64))


# -------------------------------------------------------------------------------- fits


def fit_sphere(points: ArrayLike, radius: ArrayLike = 0.0) -> BoundingSphere:
    """Return the smallest sphere around points (3, n) grown by radii (n,).

    The radius is enlarged for the rounding of the centre to single precision, and by the
    pad, about 10^-5 of the coordinates.
    """
    grown = grown_points(points, radius)
    center = smallest_ball(grown.center, grown.radius).astype(np.float32)
    offset = grown.center - center[:, None].astype(np.float64)
    reach = (np.linalg.norm(offset, axis=0) + grown.radius).max()
    reach = reach * (1.0 + 1e-15) + float(DIAGONAL) * grown.pad
    return BoundingSphere(center[:, None], rounded_up([reach]))


def fit_aabb(points: ArrayLike, radius: ArrayLike = 0.0) -> Aabb:
    """Return the smallest axis-aligned box, up to rounding, around grown points."""
    grown = grown_points(points, radius)
    lower = (grown.center - grown.radius).min(axis=1) - grown.pad
    upper = (grown.center + grown.radius).max(axis=1) + grown.pad
    return Aabb(rounded_down(lower), rounded_up(upper))


def fit_obb(points: ArrayLike, radius: ArrayLike = 0.0) -> Slabs:
    """Return a small oriented box around grown points, as three slabs.

    Except for rounding it is never larger than the axis-aligned box, but not always the
    smallest. The axes are rounded first and the slabs measured along the rounded axes, so
    rounding excludes no point.
    """
    grown = grown_points(points, radius)
    return _slabs(grown, box_axes(grown).astype(np.float32).astype(np.float64))


def fit_k_dop(points: ArrayLike, radius: ArrayLike = 0.0, directions: int = 14) -> Slabs:
    """Return the slabs of fixed orientations around grown points.

    Every plane touches a point, up to rounding. With 10 directions, edges are bevelled on
    the axis that gives the least area.

    Raises
    ------
    ValueError
        If `directions` is not 6, 10 or 14, or from `grown_points`.
    """
    if directions not in ORIENTATIONS:
        known = ", ".join(map(str, ORIENTATIONS))
        raise ValueError(f"slabs of {directions} directions: there are {known}")
    grown = grown_points(points, radius)
    choices = [_slabs(grown, normals) for normals in ORIENTATIONS[directions]]
    return min(choices, key=_area_of_slabs) if len(choices) > 1 else choices[0]


def _slabs(points: GrownPoints, normals: NDArray[np.float64]) -> Slabs:
    """Return slabs (s, 3) that enclose all points and their pads."""
    low, high = _ranges(normals, points.center, points.radius)
    spread = np.abs(normals).sum(axis=1)
    return Slabs(
        np.ascontiguousarray(normals.T, np.float32),
        rounded_down(low.min(axis=1) - spread * points.pad),
        rounded_up(high.max(axis=1) + spread * points.pad),
        spread.astype(np.float32),
    )


def _ranges(normals: NDArray[np.float64], points: ArrayLike, radius: ArrayLike) -> Any:
    """Return the smallest and largest n . x of each grown point, (s, n) each."""
    along = normals @ np.asarray(points, np.float64)
    lengths = np.linalg.norm(normals, axis=1)[:, None]
    grown = lengths * np.asarray(radius, np.float64)
    return along - grown, along + grown


# ----------------------------------------------------------------- areas and containment


def _area_of_sphere(sphere: BoundingSphere) -> float:
    return float(4.0 * np.pi * np.float64(sphere.radius[0]) ** 2)


def _area_of_aabb(box: Aabb) -> float:
    a, b, c = np.subtract(box.upper, box.lower, dtype=np.float64)
    return float(2.0 * (a * b + b * c + c * a))


def _area_of_slabs(slabs: Slabs) -> float:
    return polytope_area(slabs.normal.T.astype(np.float64), slabs.lower, slabs.upper)


def _sphere_contains(
    sphere: BoundingSphere, points: ArrayLike, radius: ArrayLike = 0.0
) -> Any:
    offset = np.asarray(points, np.float64) - sphere.center.astype(np.float64)
    reach = np.linalg.norm(offset, axis=0) + np.asarray(radius, np.float64)
    return reach <= sphere.radius[0]


def _within(
    volume: Any, normals: NDArray[Any], points: ArrayLike, radius: ArrayLike
) -> Any:
    low, high = _ranges(normals.astype(np.float64), points, radius)
    inside = (low >= volume.lower[:, None]) & (high <= volume.upper[:, None])
    return inside.all(axis=0)


def _aabb_contains(box: Aabb, points: ArrayLike, radius: ArrayLike = 0.0) -> Any:
    return _within(box, _AXES, points, radius)


def _slabs_contain(slabs: Slabs, points: ArrayLike, radius: ArrayLike = 0.0) -> Any:
    return _within(slabs, slabs.normal.T, points, radius)


VOLUMES = {
    "sphere": Volume(fit_sphere, _area_of_sphere, _sphere_contains),
    "AABB": Volume(fit_aabb, _area_of_aabb, _aabb_contains),
    "OBB": Volume(fit_obb, _area_of_slabs, _slabs_contain),
} | {
    f"{k}-DOP": Volume(partial(fit_k_dop, directions=k), _area_of_slabs, _slabs_contain)
    for k in ORIENTATIONS
}
