"""Tests whether shapes are closed, and whether points are inside of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Mesh, Shape, Sphere

MOST_FACES = 20_000  # larger meshes are not tested


def outward(mesh: Mesh) -> float | None:
    """Return 1 if (b - a) x (c - a) points outwards on the faces of a closed mesh.

    -1 if it points inwards, 0 for an open mesh. None if unknown: for more than `MOST_FACES`
    faces, or inconsistent orientation. Vertices at equal positions are merged.
    """
    if len(mesh.faces) > MOST_FACES:
        return None
    _, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, counts = np.unique(np.sort(edges), axis=0, return_counts=True)
    if not np.all(counts == 2):
        return 0.0
    if len(np.unique(edges, axis=0)) < len(edges):
        return None
    middle = mesh.vertices.mean(axis=0, dtype=np.float64)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - middle for k in range(3))
    return float(np.sign(np.einsum("ij,ij->", a, np.cross(b, c)))) or None


def is_closed(shape: Shape) -> bool:
    """Return whether a shape is known to be closed."""
    return isinstance(shape, Sphere) or (isinstance(shape, Mesh) and bool(outward(shape)))


def encloses(shape: Shape, point: NDArray[np.float64]) -> bool:
    """Return whether a point is inside of a closed shape.

    For a mesh, the solid angles of its faces [VanOosterom1983] add up to 4 pi for a point
    inside and to 0 outside.
    """
    if isinstance(shape, Sphere):
        local = np.linalg.solve(shape.to_world, np.append(point, 1.0))[:3]
        return bool(np.linalg.norm(local) < 1.0)
    assert isinstance(shape, Mesh)
    corners = shape.vertices.astype(np.float64) - point
    a, b, c = (corners[shape.faces[:, k]] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
    below += lb * np.einsum("ij,ij->i", a, c) + la * np.einsum("ij,ij->i", b, c)
    return bool(abs(np.sum(2.0 * np.arctan2(volume, below))) > 2.0 * np.pi)
