"""Rays in packets of 16 that have less and less in common."""

from __future__ import annotations

import functools

import numpy as np

from renderer.kernels.records.batch import NODES
from reports.accelerator_trials.meshes import displaced_icosphere
from reports.accelerator_trials.rays import camera_rays, in_batches
from reports.limits.row import Row
from reports.limits.structures.work import counted
from reports.limits.vectors import unit

SIDE = 32  # pixels
BALL = displaced_icosphere(16)  # 5120 triangles


def _packet_cost(spread: float, name: str) -> float:
    """Return the nodes a ray's packet visits, over those that it would visit alone."""
    origin, direction, _ = camera_rays(BALL.view, SIDE, SIDE).rows()
    rng = np.random.default_rng(50)
    # towards other points of the ball, and from other places
    target = origin + 3.5 * direction + spread * rng.standard_normal(origin.shape)
    start = origin + spread * rng.standard_normal(origin.shape)
    rays = in_batches(start, unit(target - start), np.inf)
    together, alone = (
        counted(name, BALL, rays, coherent=one)[NODES].mean() for one in (True, False)
    )
    return float(together / alone)


ROWS = (
    Row(
        name="packets-incoherent",
        method="BVH, 16 rays in a packet",
        stress="spread of the rays over the size of the object",
        measure=functools.partial(_packet_cost, name="bvh"),
        quantity="cost",
        unit="nodes of the packet over nodes of the ray alone",
        strengths=(0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0),
        tolerance=4.0,
        holds_at=0.03,
        fails_at=0.3,
        why="A packet visits what any of its rays must visit.",
        instead="One ray at a time against a node of eight children, as after a bounce.",
        source="measured here",
    ),
)
