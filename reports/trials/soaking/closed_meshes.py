"""Closed meshes, and rays from inside of them: anywhere, or past edges and vertices.

Number j of ray i is a function of both (SplitMix64 [Steele2014] at place 8 i + j), so that
any part of the rays can be made alone, by any thread.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel, kernel
from renderer.kernels.records.batch import CAPACITY, PADDING
from reports.trials.meshes import displaced_icosphere
from reports.trials.rays import RayBatches

Floats = NDArray[np.float64]
NEAREST, FARTHEST = -8.0, -2.0  # exponents of 10: how near rays pass, in lengths of edges
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


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


# ----------------------------------------------------------------------------------- rays


def rays_from_inside(mesh: ClosedMesh, aimed: bool, first: int, count: int) -> RayBatches:
    """Return rays number `first` and following, in batches.

    Parameters
    ----------
    mesh
        They start inside of it.
    aimed
        Whether they pass edges, a vertex each eighth time, at 10^-8 to 10^-2 of the edge's
        length, evenly in its logarithm; else they go anywhere.
    first, count
        Which and how many; `first` below 2^60.
    """
    batches = -(-count // CAPACITY)
    origin, direction = np.zeros((2, batches, 3, CAPACITY + PADDING), np.float32)
    make_rays(*mesh.edges, mesh.starts, aimed, np.uint64(first), count, origin, direction)
    counts = np.full(batches, CAPACITY)
    counts[-1] = count - CAPACITY * (batches - 1)
    ends = np.full((batches, CAPACITY + PADDING), np.inf, np.float32)
    return RayBatches(origin, direction, ends, counts)


@entry_kernel
def make_rays(firsts, seconds, starts, aimed, first, count, origin, direction):  # type: ignore[no-untyped-def]
    """Fill origin and direction (batches, 3, stride) with `count` rays."""
    for i in range(count):
        ray = first + np.uint64(i)
        angle = 2.0 * math.pi * _number(ray, 0)
        x, y, z = _direction(_number(ray, 1), _number(ray, 2))
        ox = starts.ring * math.cos(angle) + starts.radius * x + starts.away
        oy = starts.ring * math.sin(angle) + starts.radius * y + starts.away
        oz = starts.radius * starts.stretch * z + starts.away
        x, y, z = _direction(_number(ray, 3), _number(ray, 4))
        if aimed:
            e = int(_number(ray, 5) * len(firsts))
            ex = seconds[e, 0] - firsts[e, 0]
            ey = seconds[e, 1] - firsts[e, 1]
            ez = seconds[e, 2] - firsts[e, 2]
            along = 0.0 if ray % np.uint64(8) == np.uint64(0) else _number(ray, 6)
            exponent = NEAREST + (FARTHEST - NEAREST) * _number(ray, 7)
            aside = math.sqrt(ex * ex + ey * ey + ez * ez) * 10.0**exponent
            x = firsts[e, 0] + along * ex + aside * x - ox
            y = firsts[e, 1] + along * ey + aside * y - oy
            z = firsts[e, 2] + along * ez + aside * z - oz
            inverse = 1.0 / math.sqrt(x * x + y * y + z * z)
            x, y, z = x * inverse, y * inverse, z * inverse
        b, k = i // CAPACITY, i % CAPACITY
        origin[b, 0, k], origin[b, 1, k], origin[b, 2, k] = ox, oy, oz
        direction[b, 0, k], direction[b, 1, k], direction[b, 2, k] = x, y, z


@kernel
def _number(ray, j):  # type: ignore[no-untyped-def]
    """Return number j of a ray, in [0, 1): the 53 upper bits of SplitMix64's."""
    bits = (ray * np.uint64(8) + np.uint64(j + 1)) * _GOLDEN
    bits = (bits ^ (bits >> np.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * _SECOND
    bits ^= bits >> np.uint64(31)
    return float(bits >> np.uint64(11)) * 2.0**-53


@kernel
def _direction(a, b):  # type: ignore[no-untyped-def]
    """Return a point of the unit sphere, uniformly distributed."""
    z = 1.0 - 2.0 * a
    radius = math.sqrt(1.0 - z * z)
    return (
        radius * math.cos(2.0 * math.pi * b),
        radius * math.sin(2.0 * math.pi * b),
        z,
    )
