"""Which meshes are closed, and what is inside of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Mesh

MOST_FACES = 20_000  # more are not looked at


def is_closed(mesh: Mesh) -> bool:
    """Return whether every edge belongs to two faces; equal vertices count as one."""
    if len(mesh.faces) > MOST_FACES:
        return False
    _, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]))
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return bool(np.all(counts == 2))


def encloses(mesh: Mesh, point: NDArray[np.float64]) -> bool:
    """Return whether a point is inside of a closed mesh, by the solid angle of its faces.

    That is 4 pi inside and 0 outside; each face's by its three corners seen from the point
    [VanOosterom1983].
    """
    if not is_closed(mesh):
        return False
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
    below += lb * np.einsum("ij,ij->i", a, c) + la * np.einsum("ij,ij->i", b, c)
    return bool(abs(np.sum(2.0 * np.arctan2(volume, below))) > 2.0 * np.pi)
