"""Panes: flat glass, behind which light samples find the lights that are there."""

from __future__ import annotations

import numpy as np

from renderer.kernels.records.kernel_scene import FIRST_BSDF
from renderer.scene.materials import kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import Disk, Mesh, Rectangle, Shape

MOST_DIRECTIONS = 12
"""Of the faces of a mesh that counts as panes: a box has 6. Behind other glass light seldom
lies where a straight line finds it."""


def glass_stages(scene: Scene) -> int:
    """Return the bits of BSDFs that only reflect, refract or let straight through."""
    return sum(
        FIRST_BSDF << k
        for k, kind in enumerate(scene.materials.kinds)
        if kind.delta and kind.transmits and not kind.smooth
    )


def has_panes(scene: Scene) -> bool:
    """Return whether there are panes, in the world and not in instances alone."""
    glass = glass_stages(scene)
    of_shapes = scene.materials.stages(scene.description.shapes)
    return any(
        stages & glass and _is_flat(shape)
        for shape, stages in zip(scene.description.shapes, of_shapes, strict=False)
    )


def _is_flat(shape: Shape) -> bool:
    if any(side is not None and kind_of(side).straight for side in sides(shape.bsdf)):
        return True  # nothing is refracted, whatever the shape
    if not isinstance(shape, Mesh):
        return isinstance(shape, Rectangle | Disk)
    a, b, c = (shape.vertices[shape.faces[:, k]].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return len(np.unique(np.round(normals, 2) + 0.0, axis=0)) <= MOST_DIRECTIONS
