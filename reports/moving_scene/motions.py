"""Three ways to move the triangles of a mesh, for the study of refit against rebuild."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reports.accelerator_trials.meshes import StudyMesh

Corners = NDArray[np.float64]  # (n, 3 corners, 3)


class Motion(NamedTuple):
    """One way to move: corners at rest -> where they are at `progress` 0 to 1."""

    name: str
    about: str
    move: Callable[[Corners, float], Corners]

    def at(self, rest: StudyMesh, progress: float) -> StudyMesh:
        """Return the mesh on its way; each triangle gets corners of its own."""
        corners = self.move(rest.vertices[rest.faces].astype(np.float64), progress)
        vertices = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        return replace(rest, vertices=vertices, faces=faces)


def _wave(corners: Corners, progress: float) -> Corners:
    """Let two waves pass along x, 0.15 high, and come to rest where they began."""
    lift = 0.15 * np.sin(2.0 * np.pi * (corners[..., 0] - 2.0 * progress))
    lift -= 0.15 * np.sin(2.0 * np.pi * corners[..., 0])
    return corners + lift[..., None] * np.array([0.0, 0.0, 1.0])


def _twist(corners: Corners, progress: float) -> Corners:
    """Turn about the x axis by up to two turns per unit of x."""
    angle = 4.0 * np.pi * progress * corners[..., 0]
    x, y, z = np.moveaxis(corners, -1, 0)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack((x, cosine * y - sine * z, sine * y + cosine * z), axis=-1)


def _mixing(corners: Corners, progress: float) -> Corners:
    """Fly straight to the place of another triangle, where all have arrived at the end."""
    places = corners.mean(axis=1)
    goal = places[np.random.default_rng(0).permutation(len(places))]
    return corners + progress * (goal - places)[:, None]


MOTIONS = (
    Motion("wave", "two gentle waves pass along the ball", _wave),
    Motion("twist", "the ball is wrung about an axis, two turns per radius", _twist),
    Motion("mixing", "every triangle flies to the place of another", _mixing),
)
