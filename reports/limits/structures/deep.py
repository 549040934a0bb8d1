"""Objects that get smaller by half again and again: a teapot's teapot's teapot."""

from __future__ import annotations

import functools

import numpy as np

from reports.accelerator_trials.rays import in_batches
from reports.limits.row import Row
from reports.limits.structures.work import UNIT, soup_mesh, work_of_a_ray
from reports.limits.vectors import directions

RAYS = 256
NAMES = {
    "bvh": ("BVH by surface area", 20.0),
    "kd-sah": ("k-d tree by surface area", 10.0),
    "octree": ("Octree", 10.0),
}


def _nested(count: float, name: str) -> float:
    """Return the work of rays at the smallest of triangles at 1, 1/2, 1/4 and so on."""
    n = int(count)
    rng = np.random.default_rng(60)
    size = 2.0 ** -np.arange(n)[:, None, None]
    corners = size * (np.ones(3) + 0.3 * rng.uniform(-1.0, 1.0, (n, 3, 3)))
    target = np.repeat(corners[-1:].mean(axis=1), RAYS, axis=0)
    away = directions(RAYS, rng)
    rays = in_batches(target + 2.0 * away, -away, np.inf)
    return work_of_a_ray(name, soup_mesh(corners), rays)


ROWS = tuple(
    Row(
        name=f"halves-{name}",
        method=method,
        stress="triangles, each half as large as the one before",
        measure=functools.partial(_nested, name=name),
        quantity="cost",
        unit=UNIT,
        strengths=(2.0, 5.0, 10.0, 20.0, 50.0, 100.0),
        tolerance=30.0,
        holds_at=holds_at,
        fails_at=50.0,
        why="After 24 halvings they are smaller than the rounding of a ray that starts "
        "beside the first: for all it knows it meets every one of them.",
        instead="Leave out what is smaller than rounding; no picture shows it.",
        source="measured here",
    )
    for name, (method, holds_at) in NAMES.items()
)
