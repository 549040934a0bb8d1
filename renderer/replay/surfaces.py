"""The vertices from which Mitsuba computes hits, exactly as it stores them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernel_scene import RectangleSurfaces
from renderer.scene_file.description import Mesh, SceneDescription


class ReplaySurfaces(NamedTuple):
    """Columns by triangle, counted from the first of its kind; three vertices in turn."""

    triangles: NDArray[np.float32] | None  # (9, n)
    rectangles: NDArray[np.float32] | None  # (9, 2 n): the halves of each, one by one


def replay_surfaces(
    description: SceneDescription, rectangles: RectangleSurfaces | None
) -> ReplaySurfaces:
    """Return the vertices of a scene's triangles and of its rectangles' halves."""
    meshes = [shape for shape in description.every_shape if isinstance(shape, Mesh)]
    corners = [mesh.vertices[mesh.faces].reshape(-1, 9).T for mesh in meshes]
    return ReplaySurfaces(
        np.ascontiguousarray(np.concatenate(corners, axis=1), np.float32)
        if meshes
        else None,
        None if rectangles is None else _halves(rectangles),
    )


def _halves(rectangles: RectangleSurfaces) -> NDArray[np.float32]:
    """Return the two triangles that Mitsuba makes of each rectangle [run]."""
    # in double precision the sums are exact enough to round to the stored vertices
    a = rectangles.corner.astype(np.float64)
    b, c = a + rectangles.edge1, a + rectangles.edge2
    d = b + rectangles.edge2
    halves = np.stack([np.vstack([b, c, a]), np.vstack([b, d, c])], axis=2)
    return np.ascontiguousarray(halves.reshape(9, -1), np.float32)
