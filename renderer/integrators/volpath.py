"""Path tracing with participating media: the volume rendering equation by Monte Carlo.

L(x, w) = T(x, y) L_o(y, w) + integral over t of T(x, x_t) sigma_s(x_t) S(x_t, w), where y
is the visible surface point, T the transmittance, and S the radiance that the phase
function scatters into the direction w [Pharr2023, chapter 14]. Compared with `path`, a
ray's flight may also end in a medium, before it reaches a surface.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.integrators.kind import Case, Decision, IntegratorKind
from renderer.integrators.path import INTEGRATOR as PATH
from renderer.integrators.path import read_paths, whole_paths
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import camera_hits, intersect, reset_hits
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.media import (
    begin_in_medium,
    fly,
    hide_lamps,
    leave_surfaces,
    scatter_collisions,
)
from renderer.integrators.stages.media_shadows import light_collisions, light_surfaces
from renderer.integrators.stages.near_lamps import light_near_lamps
from renderer.integrators.stages.scatter import scatter
from renderer.kernels.jit import kernel, method_kernel


@method_kernel
def trace_paths(scene, tile, sample, work):
    """Add the samples of a tile's squares to `work.radiance`."""
    follow_paths(scene, tile, sample, work, None)


@method_kernel
def trace_paths_near_lamps(scene, tile, sample, work):
    """Add the samples of a tile's squares, with equiangular points near lamps in fog."""
    follow_paths(scene, tile, sample, work, scene.fog_lamps)


@kernel
def follow_paths(scene, tile, sample, work, lamps):
    """Add the samples of a tile's squares; `lamps` is an array, or None at compile time."""
    rays, hits = work.rays, work.hits
    count = camera_hits(scene, tile, sample, work)
    if scene.settings.max_depth < 1:
        return
    begin_in_medium(scene.media, work, count)
    zero, step = np.int64(0), np.int64(0)
    while count > 0:
        if lamps is not None:
            light_near_lamps(scene, tile, sample, step, work, count, lamps)
        count, collisions = fly(scene, tile, sample, step, work, count, lamps)
        add_emitted_light(scene, work, zero, count, True)
        group_by_bsdf(scene, work, zero, count)
        light_surfaces(scene, tile, sample, step, work)
        light_collisions(scene, tile, sample, step, work, collisions, zero, lamps)
        count = scatter(scene, tile, sample, step, work)
        count = leave_surfaces(scene, work, count, scene.settings.max_depth - 1)
        count = scatter_collisions(scene, tile, sample, step, work, collisions, count)
        reset_hits(hits, zero, count)
        intersect(scene.groups, rays, hits, zero, count, False, None)
        if scene.settings.hide_emitters != 0:
            hide_lamps(scene, work, count, True)
        step += 1


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    if case.reduce and not case.media and not case.straight:
        say("method", "path: without media, and surfaces that let shadow rays through")
        return PATH.decide(case, say)
    say("method", "volpath, as requested")
    return whole_paths("volpath", case, mirrors=True, random=True)


INTEGRATOR = IntegratorKind(
    "paths that participating media scatter and absorb on their way",
    trace_paths,
    _decide,
    read_paths,
    described=("max_depth", "rr_depth"),
    sees_lights=True,
    scatters=True,
    media=True,
    trace_near_lamps=trace_paths_near_lamps,
)
