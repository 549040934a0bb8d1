"""The numbers from which Mitsuba computes camera rays and hits, as it stores them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.replay.camera import ReplayCamera, replay_camera
from renderer.replay.instance_matrices import instance_matrices
from renderer.replay.triangle_arithmetic import face_normals, uv_tangents
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
    vertex_normal: Any  # interpolated, unit; the geometric one where there are none
    tangent: Any  # dp/du
    u: Any  # texture coordinates of triangles and rectangles
    v: Any


class ReplaySurfaces(NamedTuple):
    """Columns by triangle, counted from the first of its kind; three vertices in turn."""

    triangles: NDArray[np.float32] | None  # (9, n)
    rectangles: NDArray[np.float32] | None  # (9, 2 n): the halves of each, one by one
    rectangle_normals: NDArray[np.float32] | None  # (3, 2 n) unit, of the halves
    rectangle_vertex_normals: NDArray[np.float32] | None  # (3, 2 n) unit
    rectangle_tangents: NDArray[np.float32] | None  # (3, 2 n) dp/du of the halves
    disks: NDArray[np.float32] | None  # (24, n): rows of to_world, then of to_object
    cylinders: NDArray[np.float32] | None  # (24, n)
    instances: NDArray[np.float32] | None  # (24, n): see `instance_matrices`
    camera: ReplayCamera


def replay_surfaces(
    description: SceneDescription, measured_camera: Sequence[float] | None
) -> ReplaySurfaces:
    """Return what Mitsuba has of a scene's flat shapes, cylinders and camera."""
    meshes = [shape for shape in description.every_shape if isinstance(shape, Mesh)]
    corners = [mesh.vertices[mesh.faces].reshape(-1, 9).T for mesh in meshes]
    rectangles = [s for s in description.every_shape if isinstance(s, Rectangle)]
    halves, vertex_normals = _halves(rectangles), _vertex_normals(rectangles)
    return ReplaySurfaces(
        np.ascontiguousarray(np.concatenate(corners, axis=1), np.float32)
        if meshes
        else None,
        halves,
        None if halves is None else face_normals(*_edges(halves)),
        vertex_normals,
        None if halves is None else _tangents(halves),
        _matrices([s for s in description.every_shape if isinstance(s, Disk)]),
        _matrices([s for s in description.every_shape if isinstance(s, Cylinder)]),
        instance_matrices(description.instances),
        replay_camera(description.camera, measured_camera),
    )


def _halves(rectangles: Sequence[Rectangle]) -> NDArray[np.float32] | None:
    """Return the two triangles that Mitsuba makes of each rectangle [run]."""
    if not rectangles:
        return None
    corners = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    placed = np.array([place_points(shape.to_world, corners) for shape in rectangles])
    halves = placed[:, [[1, 2, 0], [1, 3, 2]]]  # (n, half, vertex, xyz)
    return np.ascontiguousarray(halves.reshape(-1, 9).T)


def _vertex_normals(rectangles: Sequence[Rectangle]) -> NDArray[np.float32] | None:
    """Return the normal of each half's vertices [run]."""
    if not rectangles:
        return None
    up = np.array([[0, 0, 1]])
    normals = [place_normals(shape.to_world, up) for shape in rectangles]
    return np.ascontiguousarray(np.repeat(np.concatenate(normals), 2, axis=0).T)


def _edges(halves: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return halves[3:6] - halves[0:3], halves[6:9] - halves[0:3]


def _tangents(halves: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return dp/du of the halves, whose uv run over the whole rectangle."""
    uvs = np.array([[1, 0, 0, 1, 0, 0], [1, 0, 1, 1, 0, 1]], np.float32)
    return uv_tangents(*_edges(halves), np.tile(uvs.T, halves.shape[1] // 2))


def _matrices(shapes: Sequence[Disk | Cylinder]) -> NDArray[np.float32] | None:
    if not shapes:
        return None
    matrices = np.array([shape.to_world for shape in shapes])
    both = np.stack([matrices, np.linalg.inv(matrices)], axis=1)[:, :, :3]
    return np.ascontiguousarray(both.reshape(-1, 24).T, np.float32)
