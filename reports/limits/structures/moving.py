"""A tree fitted to a later frame against one built for it, in nodes a ray visits."""

from __future__ import annotations

import functools

import numpy as np

from renderer.accelerators.bvh.bvh_refit import refit_bvh
from renderer.kernels.records.batch import NODES
from renderer.plugins.shapes.extents import extents_of
from reports.accelerator_trials.meshes import displaced_icosphere, triangle_surfaces
from reports.accelerator_trials.rays import random_rays
from reports.accelerator_trials.tracing import make_query, tallied
from reports.limits.row import Row
from reports.moving_scene.motions import MOTIONS, Motion
from reports.moving_scene.study import built, group_of

FREQUENCY = 7  # 980 triangles
RAYS = 1024


def _nodes_refitted(per_cent: float, motion: Motion) -> float:
    """Return the nodes a ray visits in the refitted tree, over those in a new one."""
    rest = motion.at(displaced_icosphere(FREQUENCY), 0.0)
    mesh = motion.at(rest, per_cent / 100.0)
    columns = np.arange(mesh.triangles)
    extents = extents_of("triangles", triangle_surfaces(mesh), columns)
    trees = refit_bvh(built(rest), extents, group_of(mesh)), built(mesh)
    query = make_query("random", random_rays(mesh, RAYS))
    old, new = (float(tallied(t, query, query.batches)[NODES].mean()) for t in trees)
    return old / new


def _row(motion: Motion, holds_at: float, fails_at: float | None, why: str) -> Row:
    return Row(
        name=f"refit-{motion.name}",
        method="BVH refitted to a later frame",
        stress=f"per cent of the motion: {motion.about}",
        measure=functools.partial(_nodes_refitted, motion=motion),
        quantity="cost",
        unit="nodes a ray, refitted over rebuilt",
        strengths=(1.0, 2.0, 5.0, 10.0, 25.0, 50.0, 100.0),
        tolerance=1.5,
        holds_at=holds_at,
        fails_at=fails_at,
        why=why,
        instead="Nothing." if fails_at is None else "Build anew when rays cost too much.",
        source="measured here; the page of accelerators has times",
    )


ROWS = tuple(
    _row(motion, *limits)
    for motion, limits in zip(
        MOTIONS,
        (
            (100.0, None, "Neighbours stay neighbours, so that their boxes stay small."),
            (10.0, 50.0, "Wrung neighbours part, and long boxes overlap."),
            (10.0, 50.0, "Who shares a node was decided before anything moved."),
        ),
        strict=True,
    )
)
