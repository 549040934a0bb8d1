"""Coordinates so large that single precision is coarser than a pixel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from renderer.plugins.shapes.extents import primitive_bounds
from renderer.rendering.planning.cautions.caution import listed, name_of
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene
from renderer.scene_file.description import PerspectiveCamera

STEP = 2.0**-23  # of float32, relative
SHARE = 0.25  # of a pixel's width that a step may take


def far_coordinates(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find shapes of which every point is stored in steps of a good part of a pixel.

    For each primitive the smallest coordinate and the largest distance from the camera
    that its box allows are taken, so that it is certain.
    """
    camera = scene.description.camera
    if not isinstance(camera, PerspectiveCamera):
        return
    eye = camera.to_world[:3, 3]
    pixel = 2.0 * np.tan(np.radians(camera.fov_x / 2.0)) / camera.film.width
    shapes = scene.description.shapes
    finest = np.full(len(scene.description.every_shape), np.inf)
    coarsest = np.zeros(len(finest))
    first = 0  # primitive ids run through the kinds
    for kind, surfaces in scene.surfaces.items():
        count = scene.starts[kind][0]
        low, high = (
            side[:, :count].astype(np.float64) for side in primitive_bounds(kind, surfaces)
        )
        # a box that holds 0 in an axis has steps as fine as can be there
        least = np.where(low * high > 0.0, np.minimum(abs(low), abs(high)), 0.0).max(axis=0)
        reach = np.maximum(abs(low - eye[:, None]), abs(high - eye[:, None]))
        step = STEP * least / (pixel * np.linalg.norm(reach, axis=0))
        owner = scene.shape[first : first + count]
        np.minimum.at(finest, owner, step)
        np.maximum.at(coarsest, owner, step)
        first += scene.starts[kind][-1]
    far = [k for k in range(len(shapes)) if SHARE < finest[k] < np.inf]
    if far:
        worst = max(coarsest[far])
        found = [name_of(shapes[k]) for k in far]
        yield (
            f"single precision steps by up to {worst:.2g} pixels where these are: "
            f"{listed(found)}; move the scene to the origin"
        )
