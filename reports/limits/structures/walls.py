"""A wall that lies exactly where a structure cuts: both cells hold it."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from reports.accelerator_trials.rays import in_batches
from reports.limits.row import Row
from reports.limits.structures.work import soup_mesh, work_of_a_ray
from reports.limits.vectors import directions

RAYS = 512
NAMES = {
    "kd-middle": "k-d tree cut in the middle",
    "octree": "Octree",
}


def corners_at(side: int, place: float) -> NDArray[np.float64]:
    """Return a wall at x = place of 2 side^2 triangles, and dust around it.

    Two tiny triangles in opposite corners pin the bounds to [-1, 1]^3, so that the first
    cut is at 0: dust alone would leave it wherever its outermost grains are.
    """
    y, z = (grid.ravel() for grid in np.mgrid[0:side, 0:side] * (2.0 / side) - 1.0)
    step = 2.0 / side
    a, b, c, d = (
        np.stack((np.full_like(y, place), y + p * step, z + q * step), axis=1)
        for p, q in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    wall = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    rng = np.random.default_rng(40)
    dust = rng.uniform(-0.99, 0.99, (side * side, 1, 3)) + 0.01 * rng.uniform(
        -1.0, 1.0, (side * side, 3, 3)
    )
    pin = 1.0 - 1e-4 * (1.0 - np.eye(3))
    return np.concatenate((wall, dust, (pin, -pin)))


def _cost_of_the_plane(triangles: float, name: str) -> float:
    """Return the work of a ray with the wall at 0, over that with the wall beside it."""
    side = max(1, round(np.sqrt(triangles / 2.0)))
    rng = np.random.default_rng(41)
    origin = rng.uniform(-0.9, 0.9, (RAYS, 3))
    rays = in_batches(origin, directions(RAYS, rng), np.inf)
    on, beside = (
        work_of_a_ray(name, soup_mesh(corners_at(side, place)), rays)
        for place in (0.0, 0.0371)
    )
    return on / beside


ROWS = tuple(
    Row(
        name=f"wall-{name}",
        method=f"{method}, a wall where it cuts",
        stress="triangles of the wall",
        measure=functools.partial(_cost_of_the_plane, name=name),
        quantity="cost",
        unit="work of a ray, over that with the wall beside the cut",
        strengths=(8.0, 32.0, 128.0, 512.0, 2048.0, 8192.0),
        tolerance=2.5,  # 1.4 to 1.6 at 512, for any rays; 2.1 for the octree at 32
        holds_at=8192.0,
        fails_at=None,
        why="Both cells hold the wall, so that a ray which crosses the cut goes down to "
        "it twice: half as much work again.",
        instead="A k-d tree by surface area or a BVH, which such a wall costs 2 %.",
        source="measured here",
    )
    for name, method in NAMES.items()
)
