"""The axes of a small oriented box: local minimisation by rotation from several starts.

The smallest box has two neighbouring faces that each contain an edge of the hull
[ORourke1985]. So one axis is fixed, the points are projected along it, and the best
rectangle along an edge of the projected hull is taken [Toussaint1983]. Then the next axis
is fixed, until the area stops falling. That finds a local minimum. The starts are the
coordinate axes, the principal axes, and the axes of a large triangle of the points
[Larsson2011]. The local minimum of least area is returned.

Only some 250 extreme points are used, so apart from the pass that finds them the search
costs the same for any mesh. The local minima are compared on all points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel

KEPT = 256  # most extreme points, from half as many directions
MOST_ROUNDS = 12  # most rounds of rotations about all three axes; 2 to 5 were seen

Axes = NDArray[np.float64]  # (3, 3) rows: orthonormal


class GrownPoints(NamedTuple):
    """Balls; a ball of radius 0 is a point."""

    center: NDArray[np.float64]  # (3, n)
    radius: NDArray[np.float64]  # (n,)
    # Margin for the rounding of ray tests, along each axis: the same fraction of the
    # coordinates as the padding of primitives' boxes. The test adds the part of the ray's
    # own coordinates.
    pad: float


def box_axes(points: GrownPoints) -> Axes:
    """Return three orthonormal axes, as rows, of a small box around the points.

    Its surface area is at most that of the axis-aligned box.
    """
    # relative to the mean, so that distant points lose no digits
    middle = points.center.mean(axis=1, keepdims=True)
    points = points._replace(center=points.center - middle)
    kept = _extreme_points(points)
    found = [_turned(kept, start) for start in _starts(kept.center)]
    return min([np.eye(3), *found], key=lambda axes: float(_area(points, axes[None])[0]))


def _extreme_points(points: GrownPoints) -> GrownPoints:
    """Return the points that are extreme in one of many directions."""
    if points.center.shape[1] <= KEPT:
        return points
    directions = _half_sphere(KEPT // 2)
    ends = np.empty((2, len(directions)), np.int64)
    _ends(np.ascontiguousarray(points.center), points.radius, directions, ends)
    which = np.unique(ends)
    return points._replace(center=points.center[:, which], radius=points.radius[which])


@entry_kernel
def _ends(center, radius, directions, ends):
    """Set ends[:, k] to the first and the last ball along direction k."""
    for k in range(len(directions)):
        x, y, z = directions[k, 0], directions[k, 1], directions[k, 2]
        low, high = np.inf, -np.inf
        for i in range(len(radius)):
            along = x * center[0, i] + y * center[1, i] + z * center[2, i]
            if along - radius[i] < low:
                low, ends[0, k] = along - radius[i], i
            if along + radius[i] > high:
                high, ends[1, k] = along + radius[i], i


def _half_sphere(count: int) -> NDArray[np.float64]:
    """Return evenly distributed unit vectors (count, 3), z > 0: a Fibonacci spiral."""
    k = np.arange(count) + 0.5
    z, phi = 1.0 - k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    rho = np.sqrt(1.0 - z * z)
    return np.column_stack((rho * np.cos(phi), rho * np.sin(phi), z))


def _starts(center: NDArray[np.float64]) -> list[Axes]:
    starts = [np.eye(3), np.linalg.eigh(center @ center.T)[1].T]
    # a long line, and the point farthest from it
    a = center[:, [np.argmax(np.sum(center**2, axis=0))]]
    b = center[:, [np.argmax(np.sum((center - a) ** 2, axis=0))]]
    edge = (b - a)[:, 0]
    normals = np.cross((center - a).T, edge)
    normal = normals[np.argmax(np.sum(normals**2, axis=1))]
    if (normal @ normal) > 0.0:
        x, z = edge / np.linalg.norm(edge), normal / np.linalg.norm(normal)
        starts.append(np.stack((x, np.cross(z, x), z)))
    return starts


def _area(points: GrownPoints, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the surface area of the boxes along axes (k, 3, 3)."""
    along = axes @ points.center
    edge = (along + points.radius).max(axis=2) - (along - points.radius).min(axis=2)
    a, b, c = edge.T
    return a * b + b * c + c * a


def _turned(points: GrownPoints, axes: Axes) -> Axes:
    """Rotate about each axis in turn while the area falls; return the axes."""
    area = _area(points, axes[None])[0]
    for _ in range(MOST_ROUNDS):
        before = area
        for held in range(3):
            w, u, v = axes[held], axes[(held + 1) % 3], axes[(held + 2) % 3]
            angle = _edge_angles(u @ points.center, v @ points.center)
            cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
            turned = np.stack(
                (np.broadcast_to(w, (len(angle), 3)), cos * u + sin * v, cos * v - sin * u),
                axis=1,
            )
            areas = _area(points, turned)
            best = int(areas.argmin())
            if areas[best] < area:
                area, axes = areas[best], turned[best]
        if area >= before * (1.0 - 1e-9):
            break
    return axes


def _edge_angles(x: Any, y: Any) -> NDArray[np.float64]:
    """Return the directions of the edges of the convex hull of points in a plane."""
    order = np.lexsort((y, x))
    hull = np.empty(2 * len(order) + 2, np.int64)
    hull = order[hull[: _hull(x[order], y[order], hull)]]
    edge_x, edge_y = np.diff(x[hull]), np.diff(y[hull])
    # Collinear points leave many edges that differ by rounding: 250 angles instead of 4
    # around a plate. A rectangle is unchanged by a quarter turn.
    size = np.hypot(edge_x, edge_y)
    long = size >= 1e-6 * size.max()
    angle = np.arctan2(edge_y[long], edge_x[long])
    return np.unique(np.round(angle % (np.pi / 2.0), 7))


@entry_kernel
def _hull(x, y, hull):
    """Write the closed hull of n sorted points to `hull` (2 n + 2,); return its length.

    Monotone chain: the lower side from left to right, then the upper side back.
    """
    n, count = len(x), 0
    start = 1  # second point of the current side
    hull[0] = 0
    count = 1
    for step in range(1, 2 * n - 1):
        k = step if step < n else 2 * n - 2 - step
        if step == n:
            start = count
        while count > start:
            a, b = hull[count - 2], hull[count - 1]
            turn = (x[b] - x[a]) * (y[k] - y[a]) - (y[b] - y[a]) * (x[k] - x[a])
            if turn > 0.0:
                break
            count -= 1
        hull[count] = k
        count += 1
    if count == 1:  # a single point is its own edge
        hull[1] = 0
        count = 2
    return count
