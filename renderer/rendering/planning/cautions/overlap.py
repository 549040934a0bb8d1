"""Which triangles of a plane cover one another, and how much [Sutherland1974]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def overlapping_boxes(corners: Floats, tolerance: Floats) -> tuple[Ints, Ints, Floats]:
    """Return the pairs of triangles (n, 3, 2) whose boxes share some area, and that area.

    By a sweep along the first axis; boxes that share an edge do not overlap, within the
    tolerance (n,) of their coordinates.
    """
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 0])
    low, high = low[order], high[order]
    end = np.searchsorted(low[:, 0], high[:, 0] - tolerance[order])
    count = np.maximum(end - np.arange(len(end)) - 1, 0)
    i = np.repeat(np.arange(len(count)), count)
    j = i + 1 + np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
    shared = np.minimum(high[i], high[j]) - np.maximum(low[i], low[j])
    kept = np.all(shared > tolerance[order[i], None], axis=1)
    return order[i[kept]], order[j[kept]], np.prod(shared[kept], axis=1)


def overlap(a: Floats, b: Floats) -> float:
    """Return the area that two triangles share, over that of the smaller one.

    Parameters
    ----------
    a, b : ndarray of shape (3, 3)
        Corners, in one plane; they are looked at along its normal's main axis.
    """
    normal = np.cross(a[1] - a[0], a[2] - a[0])
    axes = [k for k in range(3) if k != int(np.argmax(np.abs(normal)))]
    first, second = ([tuple(p) for p in t[:, axes].tolist()] for t in (a, b))
    smaller = min(abs(_area(first)), abs(_area(second)))
    if smaller == 0.0:
        return 0.0
    turn = 1.0 if _area(second) > 0.0 else -1.0
    part = first
    for k in range(3):
        part = _clipped(part, second[k], second[(k + 1) % 3], turn)
    return abs(_area(part)) / smaller


Point = tuple[float, ...]


def _clipped(polygon: list[Point], p: Point, q: Point, turn: float) -> list[Point]:
    """Return the part of a convex polygon on the inner side of the line through p, q."""

    def side(x: Point) -> float:
        return turn * ((q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0]))

    kept: list[Point] = []
    for k, end in enumerate(polygon):
        start = polygon[k - 1]
        from_side, to_side = side(start), side(end)
        if from_side * to_side < 0.0:
            t = from_side / (from_side - to_side)
            kept.append(tuple(s + t * (e - s) for s, e in zip(start, end, strict=True)))
        if to_side >= 0.0:
            kept.append(end)
    return kept


def _area(polygon: list[Point]) -> float:
    """Return the signed area."""
    pairs = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return 0.5 * sum(p[0] * q[1] - q[0] * p[1] for p, q in pairs)
