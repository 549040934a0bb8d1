"""What the tables of triangles, rectangles and disks share: a corner and two edges."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kinds.shapes.arrays import by_columns, mirrors, unit_normals

# The rows of a table of `places`: what a point of a flat shape needs, in one cache line.
CORNER, EDGE1, EDGE2, NORMAL = (slice(3 * k, 3 * k + 3) for k in range(4))


def flat_surfaces(record: Any, first: int, corner: Any, x: Any, y: Any) -> Any:
    """Return the record of flat shapes from rows (n, 3) of corners and edges."""
    return record(first, first + len(corner), places(corner.T, x.T, y.T))


def places(corner: Any, edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return the table (12, n) of corners, edges and unit normals, from (3, n) each."""
    return by_columns(np.concatenate([corner, edge1, edge2, unit_normals(edge1, edge2)]))


def with_normals(surfaces: Any, normals: Any) -> Any:
    """Return a record of flat shapes with other unit normals, (3, n)."""
    s = surfaces
    rows = np.concatenate([s.corner, s.edge1, s.edge2, normals])
    return surfaces._replace(places=by_columns(rows))


def rows_of(part: slice) -> property:
    """Return the attribute of a record that is a part of its `places`, (3, n)."""
    return property(lambda surfaces: surfaces.places[part])


def placed_axes(shapes: list[Any]) -> tuple[Any, Any, Any]:
    """Return the local x and y axes and the centres of shapes in the world, (n, 3)."""
    matrices = np.array([shape.to_world for shape in shapes])
    return matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 3]


def orientation(shape: Any) -> float:
    """Return -1 where the normal, the transformed +z, is opposite to edge1 x edge2."""
    return -1.0 if mirrors(shape.to_world) != shape.flip_normals else 1.0


def hull(corners: tuple[tuple[float, float], ...]) -> Callable[[Any, Any], Any]:
    """Return what makes hulls of the points corner + u edge1 + v edge2: flat, no radius."""

    def of(s: Any, order: Any) -> tuple[Any, Any, Any]:
        c, e1, e2 = (a[:, order] for a in (s.corner, s.edge1, s.edge2))
        placed = [c + np.float32(u) * e1 + np.float32(v) * e2 for u, v in corners]
        return np.stack(placed, 1), np.zeros(len(order), np.float32), unit_normals(e1, e2)

    return of


def areas(factor: float) -> Callable[[Any, Any], NDArray[np.float64]]:
    """Return what gives areas: so many times that of the parallelogram."""

    def of(s: Any, k: Any) -> NDArray[np.float64]:
        a, b = (edges[:, k].T.astype(np.float64) for edges in (s.edge1, s.edge2))
        return factor * np.linalg.norm(np.cross(a, b), axis=1)

    return of


def group(record: Any) -> Callable[..., Any]:
    """Return what makes the group of an accelerator: the fields of `patch.Patch`."""

    def of(s: Any, order: Any, ids: Any, padded: Callable[[Any], Any]) -> Any:
        edge1, edge2 = s.edge1[:, order], s.edge2[:, order]
        normal = np.cross(edge1.T.astype(np.float64), edge2.T.astype(np.float64)).T
        normal = normal.astype(np.float32)
        x, y, z = np.abs(normal)
        return record(
            padded(s.corner[:, order]),
            padded(edge1),
            padded(edge2),
            padded(normal),
            padded(x + y + z),
            ids,
            len(order),
        )

    return of
