"""What the tests of the textbook's structures share: names, scenes, rays, counts."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from kernel_probes import closest, directions, rectangles, soup, triangles

from renderer.kernels.records.batch import make_tally

REACH = 20.0  # of rays that take the fast way
RAYS = 2000
CELL_TREES = ("kd-middle", "kd-median", "kd-sah", "octree", "bsp")
TREES = (*CELL_TREES, "bvh-middle")
ACROSS_AXES = CELL_TREES[:-1]
HIERARCHIES = ("grid-nested", "grid-clusters")
GRIDS = ("grid", "grid-without-mailboxes", *HIERARCHIES)


def counts(accel: Any, origin: Any, direction: Any) -> np.ndarray:
    """The tally of rays (n, 3): rows of `tally.NAMES`, one column a ray."""
    tally = make_tally(len(origin))
    closest(accel, origin, direction, tally=tally)
    return tally[:, : len(origin)]


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


def mixed_sizes(kind: str, rng: Any) -> Any:
    """A few large ones around two swarms of small ones."""
    mixture = ((5, 9.0, 0.0), (300, 0.3, 0.0), (600, 0.3, 4.0))
    parts = [soup(kind, n, rng, size=s, center=c) for n, s, c in mixture]
    fields = [f for f in parts[0]._fields[2:] if getattr(parts[0], f) is not None]
    joined = {f: np.concatenate([getattr(p, f) for p in parts], axis=-1) for f in fields}
    first = parts[0].first
    return parts[0]._replace(first=first, end=first + 905, **joined)


def sheets(n: int, rng: Any) -> Any:
    """n parallel squares of edge 1, 1/n apart, tilted; and their axes x, y, z (normal)."""
    frame, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    x, y, z = frame.T
    corner = -0.5 * (x + y) + (np.arange(n)[:, None] / n - 0.5) * z
    return rectangles(corner, np.tile(x, (n, 1)), np.tile(y, (n, 1))), frame.T
