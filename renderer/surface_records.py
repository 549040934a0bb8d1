"""The surfaces of all shapes of one kind as one record of flat arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernel_scene import (
    CylinderSurfaces,
    DiskSurfaces,
    RectangleSurfaces,
    SphereSurfaces,
    TriangleSurfaces,
)
from renderer.scene_file.description import Cylinder, Mesh, Sphere


def surface_record(kind: str, shapes: list[Any], first: int) -> Any:
    """Return the surfaces of all shapes of a kind, with ids from `first` on."""
    match kind:
        case "triangles":
            return _triangles(shapes, first, with_uv=True)
        case "rectangles":
            return _flat(shapes, first, RectangleSurfaces)
        case "disks":
            return _flat(shapes, first, DiskSurfaces)
        case "spheres":
            return _spheres(shapes, first)
        case _:
            return _cylinders(shapes, first)


def float32(rows: Any) -> NDArray[np.float32]:
    """Return a C-ordered array in single precision."""
    return np.ascontiguousarray(rows, dtype=np.float32)


def unit_normals(edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return edge1 x edge2 / |edge1 x edge2|, all (3, n).

    In double precision: the square of an area leaves float32 for edges beyond 4e9. What
    has no area has the normal 0; no ray hits it.
    """
    n = np.cross(np.asarray(edge1, np.float64).T, np.asarray(edge2, np.float64).T)
    area = np.linalg.norm(n, axis=1, keepdims=True)
    return float32((n / np.where(area > 0.0, area, 1.0)).T)


def _triangles(meshes: list[Mesh], first: int, with_uv: bool) -> TriangleSurfaces:
    """Concatenate meshes; normals are kept if any mesh has them, uvs if they are used."""
    corners, edges1, edges2, normals, uvs = [], [], [], [], []
    smooth = any(mesh.normals is not None for mesh in meshes)
    for mesh in meshes:
        p = mesh.vertices[mesh.faces].astype(np.float32)  # (F, 3 vertices, 3)
        corners.append(p[:, 0].T)
        edges1.append((p[:, 1] - p[:, 0]).T)
        edges2.append((p[:, 2] - p[:, 0]).T)
        if smooth:
            normals.append(_vertex_normals(mesh, p))
        if with_uv:
            corner_uvs = (
                np.broadcast_to(np.array([[0, 0], [1, 0], [0, 1]]), (len(p), 3, 2))
                if mesh.uvs is None
                else mesh.uvs[mesh.faces]
            )
            uvs.append(corner_uvs.reshape(len(p), 6).T)
    count = sum(mesh.faces.shape[0] for mesh in meshes)
    edge1, edge2 = np.concatenate(edges1, axis=1), np.concatenate(edges2, axis=1)
    return TriangleSurfaces(
        first,
        first + count,
        float32(np.concatenate(corners, axis=1)),
        float32(edge1),
        float32(edge2),
        unit_normals(edge1, edge2),
        float32(np.concatenate(normals, axis=1) if smooth else np.zeros((9, 0))),
        float32(np.concatenate(uvs, axis=1) if with_uv else np.zeros((6, 0))),
        float32(np.zeros((3, 0))),
    )


def _vertex_normals(mesh: Mesh, p: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return (9, F) vertex normals; a faceted mesh beside a smooth one repeats its own."""
    if mesh.normals is not None:
        return mesh.normals[mesh.faces].reshape(len(p), 9).T.astype(np.float64)
    q = p.astype(np.float64)
    n = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.tile(-n if mesh.flip_normals else n, 3).T


def _flat(shapes: list[Any], first: int, record: Any) -> Any:
    """Return rectangles or disks as corner and edges; a disk's corner is its centre."""
    is_rectangle = record is RectangleSurfaces
    matrices = np.array([shape.to_world for shape in shapes])
    x, y, center = matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 3]
    corner, edge1, edge2 = (
        (center - x - y, 2 * x, 2 * y) if is_rectangle else (center, x, y)
    )
    return record(
        first,
        first + len(shapes),
        float32(corner.T),
        float32(edge1.T),
        float32(edge2.T),
        unit_normals(edge1.T, edge2.T),
    )


def _spheres(shapes: list[Sphere], first: int) -> SphereSurfaces:
    matrices = np.array([shape.to_world for shape in shapes])
    scale = np.linalg.norm(matrices[:, :3, 0], axis=1)
    frame = matrices[:, :3, :3] / scale[:, None, None]  # columns are the local axes
    return SphereSurfaces(
        first,
        first + len(shapes),
        float32(matrices[:, :3, 3].T),
        float32(scale),
        float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )


def _cylinders(shapes: list[Cylinder], first: int) -> CylinderSurfaces:
    matrices = np.array([shape.to_world for shape in shapes])
    lengths = np.linalg.norm(matrices[:, :3, :3], axis=1)  # of the three columns
    frame = matrices[:, :3, :3] / lengths[:, None, :]
    return CylinderSurfaces(
        first,
        first + len(shapes),
        float32(matrices[:, :3, 3].T),
        float32(lengths[:, 0]),
        float32(lengths[:, 2]),
        float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )
