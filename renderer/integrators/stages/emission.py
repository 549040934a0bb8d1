"""Stage 3, emission: the light that a path hits, of surfaces and environments."""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.surface.surface import append_hits, surface_points
from renderer.kernels.jit import call, kernel
from renderer.kernels.records.kernel_scene import (
    EMISSION,
    EMIT,
    ENVIRONMENT,
    RECORD,
    WEIGH_FOUND,
)


@kernel
def add_emitted_light(scene, work, first, count, see_environment):
    """Add the light of what `count` rays have hit, from `first` on, and of the sky."""
    lights, settings = scene.lights, scene.settings
    if lights.count == 0:
        return
    hits, points = work.hits, work.points
    if lights.choice.shape[0] != 0 and lights.choice[0, WEIGH_FOUND] != 0:
        call(
            lights.choice[0, WEIGH_FOUND],
            lights.choice[0, RECORD],
            (scene.shapes, scene.primitives.shape, points, work.rays, hits, first, count),
        )
    # an int64, as kinds of BSDFs are: a constant is compiled once more
    stage, start, order = np.int64(EMIT), np.int64(0), work.order
    found = append_hits(scene, work.rays, hits, first, count, stage, order, points, start)
    if found > 0:
        surface_points(scene, work.rays, hits, order, found, points)
    for kind in range(lights.methods.shape[0]):
        if lights.methods[kind, EMISSION] != 0 and found > 0:
            call(
                lights.methods[kind, EMISSION],
                lights.methods[kind, RECORD],
                (settings, lights, scene.shapes, points, found, work.radiance),
            )
        if lights.methods[kind, ENVIRONMENT] != 0 and see_environment:
            call(
                lights.methods[kind, ENVIRONMENT],
                lights.methods[kind, RECORD],
                (settings, lights, work.rays, hits, first, count, work.radiance),
            )
