"""The numbers from which Mitsuba computes camera rays and hits, as it stores them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.arrays import empty_rows
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.flat.disk import DiskSurfaces
from renderer.plugins.shapes.flat.rectangle import RectangleSurfaces
from renderer.plugins.shapes.flat.triangle import TriangleSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.replay.rounding.hits.instance_matrices import instance_matrices
from renderer.replay.rounding.hits.triangle_arithmetic import face_normals, uv_tangents
from renderer.scene_file.description import (
    Cylinder,
    Disk,
    Mesh,
    Rectangle,
    SceneDescription,
)
from renderer.scene_file.transforms import place_normals, place_points


class HitPoint(NamedTuple):
    """What Mitsuba knows of a hit, as scalars; valid is what the kind of surface has."""

    position: Any
    normal: Any  # geometric, unit, before any flip: outwards of a curved surface
    vertex_normal: Any  # interpolated, unit; the geometric normal without vertex normals
    tangent: Any  # dp/du
    u: Any  # texture coordinates of triangles and rectangles
    v: Any


class ExactSurfaces(NamedTuple):
    """What Mitsuba has; columns by primitive, counted from the first of its kind."""

    triangles: NDArray[np.float32]  # (9, n) three vertices in turn
    rectangles: NDArray[np.float32]  # (9, 2 n): the halves of each, one by one
    rectangle_normals: NDArray[np.float32]  # (3, 2 n) unit, of the halves
    rectangle_vertex_normals: NDArray[np.float32]  # (3, 2 n) unit
    rectangle_tangents: NDArray[np.float32]  # (3, 2 n) dp/du of the halves
    disks: NDArray[np.float32]  # (24, n): rows of to_world, then of to_object
    cylinders: NDArray[np.float32]  # (24, n)
    instances: NDArray[np.float32]  # (24, n): see `instance_matrices`


class AllSurfaces(NamedTuple):
    """The surfaces of all kinds; those that the scene lacks are empty."""

    triangles: TriangleSurfaces
    rectangles: RectangleSurfaces
    disks: DiskSurfaces
    spheres: SphereSurfaces
    cylinders: CylinderSurfaces


class Rounding(NamedTuple):
    """What the surface points of a replay are computed from."""

    exact: ExactSurfaces
    surfaces: AllSurfaces


def rounding_of(description: SceneDescription, surfaces: dict[str, Any]) -> Rounding:
    """Return what Mitsuba has of a scene's flat shapes, cylinders and instances."""
    meshes = [shape for shape in description.every_shape if isinstance(shape, Mesh)]
    corners = [mesh.vertices[mesh.faces].reshape(-1, 9).T for mesh in meshes]
    rectangles = [s for s in description.every_shape if isinstance(s, Rectangle)]
    halves, vertex_normals = _halves(rectangles), _vertex_normals(rectangles)
    instances = instance_matrices(description.instances)
    exact = ExactSurfaces(
        np.ascontiguousarray(np.concatenate([np.zeros((9, 0)), *corners], axis=1), "f4"),
        halves,
        face_normals(*_edges(halves)),
        vertex_normals,
        _tangents(halves),
        _matrices([s for s in description.every_shape if isinstance(s, Disk)]),
        _matrices([s for s in description.every_shape if isinstance(s, Cylinder)]),
        np.zeros((24, 0), np.float32) if instances is None else instances,
    )
    empty = AllSurfaces(
        TriangleSurfaces(0, 0, empty_rows(12)),
        RectangleSurfaces(0, 0, empty_rows(12)),
        DiskSurfaces(0, 0, empty_rows(12)),
        SphereSurfaces(0, 0, *(np.zeros(s, "f4") for s in ((3, 0), 0, (9, 0)))),
        CylinderSurfaces(0, 0, *(np.zeros(s, "f4") for s in ((3, 0), 0, 0, (9, 0)))),
    )
    known = {kind: surfaces[kind] for kind in AllSurfaces._fields if kind in surfaces}
    return Rounding(exact, empty._replace(**known))


def _halves(rectangles: Sequence[Rectangle]) -> NDArray[np.float32]:
    """Return the two triangles that Mitsuba makes of each rectangle."""
    if not rectangles:
        return np.zeros((9, 0), np.float32)
    corners = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    placed = np.array([place_points(shape.to_world, corners) for shape in rectangles])
    halves = placed[:, [[1, 2, 0], [1, 3, 2]]]  # (n, half, vertex, xyz)
    return np.ascontiguousarray(halves.reshape(-1, 9).T)


def _vertex_normals(rectangles: Sequence[Rectangle]) -> NDArray[np.float32]:
    """Return the normal of each half's vertices."""
    if not rectangles:
        return np.zeros((3, 0), np.float32)
    up = np.array([[0, 0, 1]])
    normals = [place_normals(shape.to_world, up) for shape in rectangles]
    return np.ascontiguousarray(np.repeat(np.concatenate(normals), 2, axis=0).T)


def _edges(halves: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return halves[3:6] - halves[0:3], halves[6:9] - halves[0:3]


def _tangents(halves: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return dp/du of the halves, whose uv run over the whole rectangle."""
    uvs = np.array([[1, 0, 0, 1, 0, 0], [1, 0, 1, 1, 0, 1]], np.float32)
    return uv_tangents(*_edges(halves), np.tile(uvs.T, halves.shape[1] // 2))


def _matrices(shapes: Sequence[Disk | Cylinder]) -> NDArray[np.float32]:
    if not shapes:
        return np.zeros((24, 0), np.float32)
    matrices = np.array([shape.to_world for shape in shapes])
    both = np.stack([matrices, np.linalg.inv(matrices)], axis=1)[:, :, :3]
    return np.ascontiguousarray(both.reshape(-1, 24).T, np.float32)
