"""Panes: flat or thin glass that light samples may pass, by refraction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.scene.materials import kind_of, sides
from renderer.scene_file.description import Disk, Mesh, Rectangle, SceneDescription, Shape

MOST_DIRECTIONS = 12
"""Largest number of face normals of a mesh that counts as panes; a box has 6."""

_FIRST_FACES = 1000  # tested first: enough to exclude nearly all other meshes


def panes(description: SceneDescription) -> NDArray[np.int32]:
    """Return 1 for each shape that is a pane, 0 for the others; (shapes,).

    Panes are flat, or transmit straight through as `thindielectric`. A scene with instances
    has none: its accelerators of panes alone would contain the instances too.
    """
    able = not description.instances
    shapes = description.every_shape
    return np.array([able and _is_pane(shape) for shape in shapes] or [False], np.int32)


def _is_pane(shape: Shape) -> bool:
    kinds = [kind_of(side) for side in sides(shape.bsdf) if side is not None]
    if not kinds or shape.radiance is not None:
        return False
    if not all(kind.delta and kind.transmits and not kind.smooth for kind in kinds):
        return False
    return any(kind.straight for kind in kinds) or _is_flat(shape)


def _is_flat(shape: Shape) -> bool:
    """Return whether the surface has few different normals."""
    if not isinstance(shape, Mesh):
        return isinstance(shape, Rectangle | Disk)
    return _has_few_directions(shape, shape.faces[:_FIRST_FACES]) and _has_few_directions(
        shape, shape.faces
    )


def _has_few_directions(mesh: Mesh, faces: NDArray[np.int32]) -> bool:
    a, b, c = (mesh.vertices[faces[:, k]].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    for _ in range(MOST_DIRECTIONS):
        if len(normals) == 0:
            break
        normals = normals[normals @ normals[0] < 0.9999]
    return len(normals) == 0
