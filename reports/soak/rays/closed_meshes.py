"""The closed meshes, and where in them rays start."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reports.accelerator_trials.meshes import displaced_icosphere

Floats = NDArray[np.float64]


class Starts(NamedTuple):
    """Where rays start: on spheres around the points of a ring, or around one point."""

    ring: float  # its radius, in the plane z = 0
    radius: float  # of the spheres
    stretch: float  # along z
    away: float  # what is added to all three coordinates


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A closed mesh: neighbours name the same vertices."""

    name: str
    vertices: NDArray[np.float32]  # (V, 3)
    faces: NDArray[Any]  # (F, 3)
    starts: Starts
    share: int  # how many of the turns it has

    @functools.cached_property
    def edges(self) -> tuple[Floats, Floats]:
        """Both ends of every edge, (E, 3) each."""
        pairs = np.concatenate([self.faces[:, [k, (k + 1) % 3]] for k in range(3)])
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        ends = self.vertices[pairs].astype(float)
        return np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])


@functools.cache
def meshes() -> tuple[ClosedMesh, ...]:
    """Return the closed meshes: few and many triangles, slivers, far away, with a hole.

    Most rays are in those of few triangles, where a ray costs least and is as near to
    edges: 2.2 microseconds for all structures in the first, 20 in the last.
    """
    return (
        _ball("ball of 20", 1, share=40),
        _ball("ball of 80", 2, share=6),
        _ball("ball of 320, stretched 50 times", 4, share=1, stretch=50.0),
        _ball("ball of 320, at 100", 4, share=3, away=100.0),
        _torus(32, 24, share=2),
        _ball("ball of 20480", 32, share=2),
    )


def _ball(
    name: str, frequency: int, share: int, stretch: float = 1.0, away: float = 0.0
) -> ClosedMesh:
    mesh = displaced_icosphere(frequency)
    # neighbours share their vertices, so that rounding moves both alike
    vertices, which = np.unique(mesh.vertices, axis=0, return_inverse=True)
    placed = (vertices * np.array([1.0, 1.0, stretch]) + away).astype(np.float32)
    faces = which.reshape(-1)[mesh.faces]
    return ClosedMesh(name, placed, faces, Starts(0.0, 0.1, stretch, away), share)


def _torus(around: int, across: int, share: int) -> ClosedMesh:
    """Return a ring of radius 1 and thickness 0.4."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(across)))
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    distance = 1.0 + 0.4 * np.cos(v)
    vertices = np.stack((distance * np.cos(u), distance * np.sin(u), 0.4 * np.sin(v)), 1)
    a, b = j * around + i, j * around + (i + 1) % around
    c, d = (((j + 1) % across) * around + k for k in (i, (i + 1) % around))
    faces = np.concatenate((np.stack((a, b, d), 1), np.stack((a, d, c), 1)))
    placed = vertices.astype(np.float32)
    return ClosedMesh("torus of 1536", placed, faces, Starts(1.0, 0.1, 1.0, 0.0), share)
