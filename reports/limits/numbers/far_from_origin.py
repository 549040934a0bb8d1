"""A whole scene, camera included, moved away from the origin of coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reports.accelerator_trials.meshes import StudyMesh, displaced_icosphere, surfaces_of
from reports.accelerator_trials.rays import camera_rays, pixel_order
from reports.limits.our_hits import nearest_hits
from reports.limits.row import Row
from reports.limits.vectors import single

SIDE = 48  # pixels
BALL = displaced_icosphere(6)  # of radius 1


def _distances(mesh: StudyMesh, moved: float, side: int = SIDE) -> NDArray[np.float64]:
    """Return how far the camera sees at each pixel, infinite beside the ball."""
    view = mesh.view
    origin, direction, _ = camera_rays(view, side, side).rows()
    shift = np.array([moved, 0.0, 0.0])
    surfaces = surfaces_of(single(mesh.vertices + shift), mesh.faces)
    start = single(origin + shift)
    t, prim = nearest_hits("triangles", surfaces, start, direction, "bvh")
    return np.where(prim < 0, np.inf, t.astype(np.float64))


def _off(distance: float) -> float:
    """Return the share of pixels whose distance is another by a thousandth of the ball."""
    truth, found = _distances(BALL, 0.0), _distances(BALL, distance)
    same = truth == found  # also both infinite
    with np.errstate(invalid="ignore"):
        return float(1.0 - np.mean(same | (np.abs(found - truth) < 1e-3)))


def picture() -> NDArray[np.uint8]:
    """Return what the camera sees at 0, 10^5, 10^6 and 10^7: nearer is brighter."""
    side = 144
    order = pixel_order(side, side)
    shown = []
    for moved in (0.0, 1e5, 1e6, 1e7):
        grey = np.zeros(side * side, np.uint8)
        distances = _distances(displaced_icosphere(10), moved, side)
        nearness = np.clip((4.6 - distances) / 2.0, 0.0, 1.0)
        grey[order] = np.where(np.isfinite(distances), 40.0 + 200.0 * nearness, 20.0)
        shown.append(grey.reshape(side, side))
    return np.repeat(np.concatenate(shown, axis=1)[..., None], 3, axis=2)


ROWS = (
    Row(
        name="far-from-origin",
        method="World coordinates in float32",
        stress="distance of the scene from the origin / its size",
        measure=_off,
        quantity="error",
        unit="of pixels whose distance is off by a thousandth of the size",
        strengths=(1e0, 1e1, 1e2, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6, 1e7),
        tolerance=0.01,
        holds_at=1e3,
        fails_at=3e4,
        why="At 10^4 float32 numbers are 10^-3 apart: vertices and the eye move there.",
        instead="Move the scene to the origin before it is written down in float32.",
        source="measured here",
        picture=picture,
        caption="The same ball of size 1 at 0, 10^5, 10^6 and 10^7; nearer is brighter.",
    ),
)
