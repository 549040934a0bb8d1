"""Path tracing [Kajiya1986]: a Monte Carlo solution of the rendering equation.

Direct lighting [Appel1968] is the same loop with two segments: camera to surface, and
surface to light.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.integrators.kind import MOST, Case, Decision, IntegratorKind
from renderer.integrators.stages.direct_light import direct_light
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import camera_hits, intersect, reset_hits
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.scatter import scatter
from renderer.integrators.stages.straight_through import drop_transparent, keep_marks
from renderer.integrators.stages.through_panes import (
    add_light_of_paths,
    aim_paths,
    begin_paths,
    keep_aims,
    light_through_panes,
)
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.records.batch import HOLES_ALONE
from renderer.kernels.records.kernel_scene import BEGIN_BOUNCE, RECORD
from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties

# A path whose throughput is below this may be ended by roulette at any bounce: it adds
# little and costs as much as a bright one. Rooms then take 2/3 of the time for the same
# error, see docs/performance.md.
DIM = 0.25
# The same where rays to the sky alone find its light: the next segment may then bring most
# of a pixel's light. With 1/4 two scenes of seven took 1.4 times as long to the same error
# as without such roulette.
DIM_UNDER_SKY = 0.125


@kernel
def begin_bounce(scene, tile, sample, work, count):
    """Draw the numbers of `count` paths at their hits, if the sampler draws in sequence."""
    sampler = scene.sampler
    if sampler[0, BEGIN_BOUNCE] != 0:
        call(
            sampler[0, BEGIN_BOUNCE],
            sampler[0, RECORD],
            (scene.primitives.shape, tile, sample, work.rays, work.hits, count),
        )


@method_kernel
def trace_paths(scene, tile, sample, work):
    """Add the samples of a tile's squares to `work.radiance`."""
    follow_paths(scene, tile, sample, work, None)


@method_kernel
def trace_paths_through_panes(scene, tile, sample, work):
    """Add the samples of a tile's squares; panes refract the light samples."""
    follow_paths(scene, tile, sample, work, True)


@kernel
def follow_paths(scene, tile, sample, work, through_panes):
    """Add the samples of a tile's squares; `through_panes` is a compile-time constant.

    After the first bounce the rays of all squares form one stream: the more rays a stream
    has, the more of them enter the same nodes.
    """
    rays, hits, settings = work.rays, work.hits, scene.settings
    count = camera_hits(scene, tile, sample, work)
    if settings.max_depth < 1:
        return
    for k in range(count):
        rays.met[rays.slot[k]] = HOLES_ALONE
    transparent = settings.transparent != 0
    if through_panes is not None:
        begin_paths(work, count)
    bounce = np.int64(0)  # a typed variable: a literal would compile every stage twice
    while count > 0:
        see_sky = bounce > 0 or settings.hide_emitters == 0
        if through_panes is None:
            add_emitted_light(scene, work, np.int64(0), count, see_sky)
        else:
            aim_paths(scene, work, count)
            add_light_of_paths(scene, work, count, see_sky)
        last = bounce + 1 >= settings.max_depth
        if transparent:
            drop_transparent(scene, work, count, last)
        if last:
            break
        begin_bounce(scene, tile, sample, work, count)
        group_by_bsdf(scene, work, np.int64(0), count)
        if through_panes is None:
            direct_light(scene, tile, sample, bounce, work)
        else:
            light_through_panes(scene, tile, sample, bounce, work)
        count = scatter(scene, tile, sample, bounce, work)
        if through_panes is not None:
            keep_aims(scene, work, count)
        if transparent:
            keep_marks(rays, count)
        reset_hits(hits, np.int64(0), count)
        intersect(scene.groups, rays, hits, np.int64(0), count, False, None)
        bounce += 1


def read_paths(properties: Properties) -> Integrator:
    """Read the properties that all path integrators share."""
    return Integrator(
        properties.element.plugin,
        max_depth=properties.integer("max_depth", -1, at_least=-1, at_most=MOST),
        rr_depth=properties.integer("rr_depth", 5, at_least=1, at_most=MOST),
        hide_emitters=properties.boolean("hide_emitters", False),
    )


def decide_direct(case: Case, depth: int) -> Decision:
    """Return the decision for direct lighting."""
    light_samples = samples = 1
    if case.requested.name == "direct":  # false if only the command line selected `direct`
        light_samples, samples = case.requested.emitter_samples, case.requested.bsdf_samples
    if case.reduce and not case.extended:  # all samples of a light at a point are equal
        light_samples, samples = min(light_samples, 1), min(samples, 1)
    return Decision(
        "direct",
        depth,
        no_roulette="direct light is two segments long",
        mirrors=case.delta and samples > 0,
        every_light=not case.replay and case.requested.moments is None,
        # BSDF samples can reach only lights that have an extent
        follow=case.extended and samples > 0,
        light_samples=light_samples,
        bsdf_samples=samples,
        random=case.extended or case.chooses,
    )


def decide_without_lights(case: Case, say: Callable[[str, str], None]) -> Decision:
    """Return the cheapest decision: without lights only camera rays are traced."""
    say("method", "direct, no bounces: without a light every path is black")
    return decide_direct(case, min(case.depth, 1))


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    depth = case.depth
    if case.reduce and depth <= 2 and not case.transparent:
        say("method", "direct: with max_depth <= 2 a path is direct light alone")
        return decide_direct(case, depth)
    if case.reduce and not case.lights:
        return decide_without_lights(case, say)
    say("method", "path, as requested")
    return whole_paths("path", case, mirrors=case.delta, random=depth > 2 or case.extended)


def whole_paths(method: str, case: Case, *, mirrors: bool, random: bool) -> Decision:
    """Return the decision for paths of any length."""
    depth, rr_depth = case.depth, case.requested.rr_depth
    plays = rr_depth < depth
    # With `transparent`, ending a path can remove light, so the mean depends on roulette.
    early = plays and case.reduce and not case.transparent
    return Decision(
        method,
        depth,
        roulette_depth=rr_depth if plays else None,
        dim_depth=1 if early else None,
        survival_scale=1.0 / DIM if early else 1.0,
        no_roulette=f"max_depth {depth} comes before rr_depth {rr_depth}",
        mirrors=mirrors,
        follow=case.smooth,
        random=random,
    )


INTEGRATOR = IntegratorKind(
    "light over many bounces, as the mean of random paths (Kajiya 1986)",
    trace_paths,
    _decide,
    read_paths,
    described=("max_depth", "rr_depth"),
    sees_lights=True,
    scatters=True,
    trace_through_panes=trace_paths_through_panes,
)
