"""Which cells a primitive reaches into: slow and exact, to check what builders did.

The separating axis test: two convex bodies are apart if and only if they are so along a
normal of a face of either or along a cross product of two edges [Gottschalk1996]. Nothing
here is shared with the builders.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.extents import Extents

_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_FACES = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
_CHUNK = 2_000  # what a core's cache holds


def reaches_into(
    extents: Extents,
    columns: NDArray[np.int64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return whether each primitive reaches into its cell.

    Parameters
    ----------
    extents : Extents
        Of all primitives, which grow by half the pad: what a builder must hold at least.
    columns : (m,)
        The primitives' columns.
    lower, upper : (m, 3)
        One cell for each of them.
    """
    parts = [
        _reaches_into(extents, columns[s], lower[s], upper[s])
        for s in (slice(i, i + _CHUNK) for i in range(0, len(columns), _CHUNK))
    ]
    return np.concatenate(parts) if parts else np.zeros(0, bool)


def _reaches_into(extents, columns, lower, upper):
    # a row for each component: NumPy is slow along rows of three
    grow = 0.5 * extents.pad
    # of a disk, whose hull is a square, the box has something to say too
    lower = np.maximum(lower.T, extents.lower[:, columns].astype(np.float64) - grow)
    upper = np.minimum(upper.T, extents.upper[:, columns].astype(np.float64) + grow)
    reaches = (lower <= upper).all(axis=0)
    lower, upper, columns = lower[:, reaches], upper[:, reaches], columns[reaches]
    points = extents.points[:, :, columns].astype(np.float64)
    growth = extents.radius[columns] + grow
    centre, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    points -= centre[:, None]
    # normals of faces first: they leave few of those that are apart at all
    for axes in (_face_normals, _box_and_edges):
        met = ~_apart_along(axes(points), points, half, growth)
        reaches[reaches] = met
        points, half, growth = points[..., met], half[:, met], growth[met]
    return reaches


def _apart_along(axes, points, half, growth):
    """Return whether hulls and boxes around the origin are apart along any of the axes."""
    apart = np.zeros(points.shape[2], bool)
    for axis in axes:
        along = _dot(points, axis[:, None])
        reach = _dot(half, np.abs(axis)) + growth * np.sqrt(_dot(axis, axis))
        apart |= (along.min(axis=0) > reach) | (along.max(axis=0) < -reach)
    return apart


def _edges(points):
    return {(a, b): points[:, b] - points[:, a] for a, b in _PAIRS}


def _face_normals(points):
    edges = _edges(points)
    for a, b, c in _FACES:
        yield _cross(edges[a, b], edges[a, c])


def _box_and_edges(points):
    """Yield the normals of boxes, and across each of their edges and each of a hull's."""
    edges = _edges(points)
    for unit in np.eye(3):
        unit = np.broadcast_to(unit[:, None], (3, points.shape[2]))
        yield unit
        for edge in edges.values():
            yield _cross(edge, unit)


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a, b):
    (ax, ay, az), (bx, by, bz) = a, b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def in_sorted(numbers: NDArray[np.int64], known: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which numbers, none below 0, are among the known ones, which ascend."""
    place = np.searchsorted(known, numbers)
    return np.append(known, -1)[place] == numbers


def require_none(what: str, numbers: NDArray[np.int64], fault: str) -> None:
    """Raise ValueError if any number is given: the first one, with its fault."""
    if numbers.size:
        raise ValueError(f"{what} {numbers[0]} (of {numbers.size} such) {fault}")


def require_lists(name: str, structure: Any, extents: Extents) -> None:
    """Check that each leaf lists primitives, each once, and has their copies beside it.

    A structure has `first` (leaves + 1,), `items`, `bounds` and `primitives`.
    """
    n, half = extents.lower.shape[1], extents.pad / 2
    first, items = structure.first, structure.items
    require_none(f"{name} leaf", np.flatnonzero(np.diff(first) < 0), "ends too early")
    if first[0] != 0 or first[-1] != len(items):
        raise ValueError(f"{name} leaves hold {first[0]} to {first[-1]} of {len(items)}")
    strange = np.flatnonzero((items < 0) | (items >= n))
    require_none(f"{name} item", strange, "is no primitive's column")
    leaf = np.repeat(np.arange(len(first) - 1), np.diff(first))
    key = np.sort(leaf * n + items)
    twice = key[1:][np.diff(key) == 0] // n
    require_none(f"{name} leaf", twice, "lists a primitive twice")
    _require_copies(name, structure.primitives, items)
    outside = extents.lower.T - half < structure.bounds[:3]
    outside |= extents.upper.T + half > structure.bounds[3:]
    lost = np.flatnonzero(outside.any(axis=1))
    require_none(f"{name} primitive", lost, "is out of bounds")


def _require_copies(name: str, primitives: Any, items: NDArray[np.int32]) -> None:
    """Check that equal items have equal ids beside them, and others do not."""
    if primitives.count != len(items):
        raise ValueError(f"{name}: {primitives.count} primitives, {len(items)} items")
    order = np.argsort(items, kind="stable")
    ids = primitives.id[: len(items)][order]
    wrong = order[1:][(np.diff(ids) == 0) != (np.diff(items[order]) == 0)]
    require_none(f"{name} item", wrong, "has another primitive beside it")
