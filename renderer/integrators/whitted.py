"""Recursive ray tracing [Whitted1980]: reflected and refracted rays are both followed.

The ray tree is a queue of weighted rays, processed by the same stages as paths. Each depth
has its own region of the ray arrays. The deepest region is traced first, one batch at a
time, so the queue stays short however many branches the tree has.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.integrators.kind import MOST, Case, Decision, IntegratorKind
from renderer.integrators.path import decide_without_lights
from renderer.integrators.stages.branch_specular import branch_specular
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.direct_light import direct_light
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import intersect, reset_hits
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.kernels.jit import method_kernel
from renderer.kernels.records.batch import CAPACITY
from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties

REGION = 2 * CAPACITY + 64  # a batch of rays has at most two children per ray
USUAL_DEPTH = 8  # if the file sets no limit: light trapped in glass never leaves
DEEPEST = 256  # each depth has an array of waiting rays, 130 KB


@method_kernel
def trace_ray_trees(scene, tile, sample, work):
    """Add the samples of a tile's square to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    waiting = work.waiting
    waiting[0] = camera_rays(scene, tile, sample, work, np.int64(0))
    if settings.max_depth < 1:
        return
    intersect(scene.camera_groups, rays, hits, np.int64(0), waiting[0], True, None)
    depth = np.int64(0)
    while depth >= 0:
        if waiting[depth] == 0:
            depth -= 1
            continue
        count = min(waiting[depth], np.int64(CAPACITY))
        waiting[depth] -= count
        first = depth * REGION + waiting[depth]
        if depth > 0:
            reset_hits(hits, first, count)
            intersect(scene.groups, rays, hits, first, count, False, None)
        add_emitted_light(
            scene, work, first, count, depth > 0 or settings.hide_emitters == 0
        )
        if depth + 1 >= settings.max_depth:
            continue
        group_by_bsdf(scene, work, first, count)
        direct_light(scene, tile, sample, depth, work)
        waiting[depth + 1] = branch_specular(scene, work, (depth + 1) * REGION)
        depth += 1


def _read(properties: Properties) -> Integrator:
    return Integrator(
        "whitted",
        max_depth=properties.integer("max_depth", 8, at_least=-1, at_most=MOST),
        hide_emitters=properties.boolean("hide_emitters", False),
        cutoff=properties.number("cutoff", 1.0 / 1024.0, above=0.0, at_most=1.0),
    )


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    requested = case.requested
    depth = USUAL_DEPTH if requested.max_depth < 0 else min(requested.max_depth, DEEPEST)
    if depth != requested.max_depth:
        say("depth", f"{depth}: a tree of rays needs a limit, and not too deep a one")
    if case.reduce and not case.lights:
        return decide_without_lights(case, say)
    if case.reduce and not case.delta:
        depth = min(depth, 2)
        say("method", "whitted without recursion: there is no mirror and no glass")
    else:
        say("method", "whitted, as requested")
    return Decision(
        "whitted",
        depth,
        no_roulette="a tree of rays ends at its depth and its cutoff",
        mirrors=case.delta,
        every_light=True,
        cutoff=requested.cutoff,
        random=case.extended,
    )


INTEGRATOR = IntegratorKind(
    "direct light, and a tree of rays through mirrors and glass (Whitted 1980)",
    trace_ray_trees,
    _decide,
    _read,
    described=("max_depth",),
    sees_lights=True,
    splits=True,
)
