"""Stage 3, emission: radiance of the area lights and environments that a path hits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.integrators.stages.surface import append_hits, surface_points
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.records.batch import CAUSTIC, ROUGH
from renderer.kernels.records.kernel_scene import (
    EMISSION,
    EMIT,
    ENVIRONMENT,
    RECORD,
    WEIGH_FOUND,
)
from renderer.plugins.bsdfs.kind import DELTA, SMOOTH
from renderer.plugins.lights.area import add_emission
from renderer.plugins.lights.environment import add_environment


@kernel
def add_emitted_light(scene, work, first, count, see_environment):
    """Add the radiance emitted towards `count` rays from index `first` on."""
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
    for kind in range(lights.methods.shape[0]):
        if lights.methods[kind, ENVIRONMENT] != 0 and see_environment:
            call(
                lights.methods[kind, ENVIRONMENT],
                lights.methods[kind, RECORD],
                (settings, lights, points, work.rays, hits, first, count, work.radiance),
            )
    # a typed int64, as for kinds of BSDFs; a literal would be compiled separately
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


# ----------------------------------------------------------------------------- caustics
# Paths without caustics: no light that a delta lobe casts onto a rough surface.
#
# Such light arrives along a path that has, seen from the camera, a smooth lobe, then a
# delta lobe, then a lamp or the environment. Passing straight through a hole or a thin
# pane counts as neither lobe. The path goes on; only its emission is not added. These
# methods are in the tables of simplified scenes only.


class CausticMarks(NamedTuple):
    """The record of the hook `mark_caustics`; it has no fields."""


@method_kernel
def mark_caustics(marks, settings, rays, end, points):
    """Update the lobe history of the paths whose first `end` rays have just scattered."""
    for k in range(end):
        slot, lobe = rays.slot[k], rays.lobe[k]
        if lobe == SMOOTH:
            rays.met[slot] = (rays.met[slot] | ROUGH) & ~CAUSTIC
        elif lobe == DELTA and rays.met[slot] & ROUGH != 0:
            rays.met[slot] |= CAUSTIC


@kernel
def _blacken(throughput, i):
    for c in range(3):
        throughput[c, i] = 0.0


@method_kernel
def add_emission_but_caustics(kind, settings, lights, shapes, points, count, radiance):
    """Add emission except caustics; the throughput of `points` may be overwritten."""
    for i in range(count):
        if points.met[points.slot[i]] & CAUSTIC != 0:
            _blacken(points.throughput, i)
    add_emission(kind, settings, lights, shapes, points, count, radiance)


@method_kernel
def add_environment_but_caustics(
    kind, settings, lights, points, rays, hits, first, count, radiance
):
    """Add the environment except caustics; the throughput of misses is overwritten."""
    for i in range(first, first + count):
        if hits.prim[i] < 0 and rays.met[rays.slot[i]] & CAUSTIC != 0:
            _blacken(rays.throughput, i)
    add_environment(kind, settings, lights, points, rays, hits, first, count, radiance)
