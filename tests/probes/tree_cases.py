"""What the tests of the kd-tree and of the octree share: scenes, rays, comparisons."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from kernel_probes import (
    Found,
    blocked,
    closest,
    directions,
    rectangles,
    spheres,
    trace,
    triangles,
    workspace,
)

from renderer.accelerators.build import build_accelerator
from renderer.kernels.records.tally import make_tally
from renderer.plugins.shapes.extents import Extents, extents_of

REACH = 20.0  # of rays that take the fast way
RAYS = 2000


def columns(surfaces: Any) -> np.ndarray:
    return np.arange(surfaces.end - surfaces.first)


def extents(kind: str, surfaces: Any) -> Extents:
    return extents_of(kind, surfaces, columns(surfaces), REACH)


def build(name: str, kind: str, surfaces: Any) -> Any:
    return build_accelerator(kind, surfaces, columns(surfaces), name, REACH)


def assert_same_hits(
    tree: Any, kind: str, surfaces: Any, origin: Any, direction: Any, t_max: Any = np.inf
) -> Found:
    """Compare nearest and any hits with brute force, bit for bit; return the hits."""
    truth = closest(
        build("brute", kind, surfaces), origin, direction, t_max=t_max, coherent=True
    )
    found = closest(tree, origin, direction, t_max=t_max)
    np.testing.assert_array_equal(found.prim, truth.prim)
    hit = truth.prim >= 0
    np.testing.assert_array_equal(found.t, truth.t)
    for name in ("t", "u", "v"):
        expected, got = (getattr(f, name)[hit] for f in (truth, found))
        np.testing.assert_array_equal(got.view(np.int32), expected.view(np.int32), name)
    np.testing.assert_array_equal(blocked(tree, origin, direction, t_max=t_max), hit)
    return truth


def counts(accel: Any, origin: Any, direction: Any) -> np.ndarray:
    """The tally of rays (n, 3): rows of `tally.NAMES`, one column a ray."""
    n = len(origin)
    work, tally = workspace(n), make_tally(n)
    work.rays.origin[:, :n] = np.asarray(origin).T
    work.rays.direction[:, :n] = np.asarray(direction).T
    work.hits.t[:n] = np.inf
    work.hits.prim[:] = -1
    trace(accel, work, 0, n, False, tally)
    return tally[:, :n]


def axis_directions() -> np.ndarray:
    """The 26 neighbours of a cell, zeros with either sign."""
    signs = itertools.product((-1.0, 0.0, -0.0, 1.0), repeat=3)
    found = [np.array(s) for s in signs if any(s)]
    return np.array([s / np.linalg.norm(s) for s in found])


def rays_in_planes(planes: np.ndarray, axes: np.ndarray, n: int, rng: Any) -> Any:
    """Rays that lie in split planes or start on them, and run along the axes or do not."""
    k = rng.integers(0, len(planes), n)
    origin = rng.uniform(-1.2, 1.2, (n, 3)).astype(np.float32)
    origin[np.arange(n), axes[k]] = planes[k]
    ways = axis_directions()
    direction = np.where(
        rng.random((n, 1)) < 0.7, ways[rng.integers(0, len(ways), n)], directions(n, rng)
    )
    in_plane = rng.random(n) < 0.7
    zero = rng.choice([0.0, -0.0], n)
    direction[in_plane, axes[k[in_plane]]] = zero[in_plane]
    return origin, direction


def walls() -> Any:
    """Unit squares in the planes x, y, z = -2, 0, 2: where cells are halved."""
    corners, edges1, edges2 = [], [], []
    places = np.indices((4, 4)).reshape(2, -1).T - 2.0
    for axis, height in itertools.product(range(3), (-2.0, 0.0, 2.0)):
        corner = np.insert(places, axis, height, axis=1)
        one, other = np.delete(np.eye(3), axis, axis=0)
        corners.append(corner)
        edges1.append(np.tile(one, (16, 1)))
        edges2.append(np.tile(other, (16, 1)))
    return rectangles(*(np.concatenate(a) for a in (corners, edges1, edges2)))


def coincident(n: int) -> Any:
    """One slanted triangle, n times."""
    return triangles(
        np.tile([[[0.1, 0.2, 0.3], [1.0, 0.1, 0.7], [0.3, 1.1, 0.5]]], (n, 1, 1))
    )


def concentric(n: int) -> Any:
    """Spheres about one centre: all centroids equal."""
    return spheres(np.zeros((n, 3)), np.geomspace(0.01, 3, n))


def line(n: int) -> Any:
    """Squares in a row, each touching the next."""
    corner = np.zeros((n, 3))
    corner[:, 0] = np.linspace(-4, 4, n, endpoint=False)
    edges = np.eye(3)[:2] * 8 / n
    return rectangles(corner, *(np.tile(e, (n, 1)) for e in edges))


def ball_in_a_stadium() -> Any:
    """5000 small triangles about a sphere of diameter 1, and two of size 1000."""
    rng = np.random.default_rng(3)
    c = 0.5 * directions(5000, rng)
    small = np.stack([c + 0.015 * directions(5000, rng) for _ in range(3)], 1)
    x, z = 1000.0, -0.6
    large = [[[-x, -x, z], [x, -x, z], [x, x, z]], [[-x, -x, z], [x, x, z], [-x, x, z]]]
    return triangles(np.concatenate((small, large)))


def rays_into_the_ball(n: int, rng: Any) -> Any:
    """From two diameters away, within reach."""
    origin = 2 * directions(n, rng)
    towards = rng.uniform(-0.3, 0.3, (n, 3)) - origin
    return origin, towards / np.linalg.norm(towards, axis=1, keepdims=True)
