"""What the tables of triangles, rectangles and disks share: a corner and two edges."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns
from renderer.plugins.shapes.arrays import mirrors, unit_normals

# The parts of a table of `places`, three rows each: what a point of a flat shape needs.
PARTS = ("corner", "edge1", "edge2", "normal")

Record = TypeVar("Record")


def with_parts(record: type[Record]) -> type[Record]:
    """Give a record that has `places` each of their parts, (3, n), as an attribute."""
    for k, name in enumerate(PARTS):
        rows = slice(3 * k, 3 * k + 3)
        setattr(record, name, property(lambda surfaces, rows=rows: surfaces.places[rows]))
    return record


@with_parts
class FlatSurfaces(NamedTuple):
    """Flat shapes first .. end - 1 by primitive id; their classes derive from this one."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2


def flat_surfaces(record: Any, first: int, corner: Any, x: Any, y: Any) -> Any:
    """Return the record of flat shapes from rows (n, 3) of corners and edges."""
    return record(first, first + len(corner), places(corner.T, x.T, y.T))


def places(corner: Any, edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return the table (12, n) of corners, edges and unit normals, from (3, n) each."""
    return by_columns(np.concatenate([corner, edge1, edge2, unit_normals(edge1, edge2)]))


def replaced(surfaces: Any, **parts: Any) -> Any:
    """Return a record of flat shapes with other `corner`, `edge1`, ..., (3, n)."""
    rows = [parts.get(name, getattr(surfaces, name)) for name in PARTS]
    return surfaces._replace(places=by_columns(np.concatenate(rows)))


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


def numbers(s: Any, columns: Any) -> tuple[Any, ...]:
    """Return the fields of `patch.Patch`."""
    edge1, edge2 = s.edge1[:, columns], s.edge2[:, columns]
    normal = np.cross(edge1.T.astype(np.float64), edge2.T.astype(np.float64)).T
    normal = normal.astype(np.float32)
    x, y, z = np.abs(normal)
    return s.corner[:, columns], edge1, edge2, normal, x + y + z
