"""A ring of triangles and three ways to move it, for the study of refit against rebuild.

A motion takes the corners at rest to where they are at `progress` 0 (at rest) to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernel_scene import TriangleSurfaces
from renderer.scene import unit_normals

Corners = NDArray[np.float64]  # (n, 3 corners, 3)

RING, TUBE = 1.0, 0.4  # radii of the ring


class Motion(NamedTuple):
    """One way to move."""

    name: str
    about: str
    move: Callable[[Corners, float], Corners]


def ring(around: int) -> Corners:
    """Return a torus of around^2 triangles, which share corners bit for bit."""
    across = around // 2
    u = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    v = np.linspace(0.0, 2.0 * np.pi, across, endpoint=False)
    far = RING + TUBE * np.cos(v)
    z = np.broadcast_to(TUBE * np.sin(v), (around, across))
    p = np.stack((far * np.cos(u), far * np.sin(u), z), axis=-1)
    a, b = p, np.roll(p, -1, axis=0)
    d, c = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    pairs = np.stack((np.stack((a, b, c), 2), np.stack((a, c, d), 2)), 2)
    return np.ascontiguousarray(pairs.reshape(-1, 3, 3))


def surfaces_of(corners: Corners) -> TriangleSurfaces:
    """Return the triangles as the renderer keeps them."""
    p = corners.astype(np.float32)
    edge1, edge2 = (np.ascontiguousarray((p[:, k] - p[:, 0]).T) for k in (1, 2))
    corner, normal = np.ascontiguousarray(p[:, 0].T), unit_normals(edge1, edge2)
    return TriangleSurfaces(0, len(p), corner, edge1, edge2, normal, None, None)


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
    Motion("wave", "two gentle waves pass along the ring", _wave),
    Motion("twist", "the ring is wrung about an axis, two turns per radius", _twist),
    Motion("mixing", "every triangle flies to the place of another", _mixing),
)
