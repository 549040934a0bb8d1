"""Direct lighting [Appel1968]: paths of two segments, by next-event estimation and MIS.

With several samples per point, the light samples are taken before the BSDF samples. Each
estimator is divided by its number of samples. MIS weights multiply each density by that
number [Veach1997, section 9.2.2].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.integrators.kind import MOST, Case, Decision, IntegratorKind
from renderer.integrators.path import begin_bounce, decide_direct, trace_paths
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.direct_light import direct_light
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import intersect, reset_hits
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.scatter import scatter
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.records.batch import CAPACITY
from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties

KEPT = CAPACITY + 64  # index of the kept camera rays, behind the rays being traced


@kernel
def _keep(rays, hits, count):
    """Copy the first `count` rays and their hits to index `KEPT` and after."""
    for i in range(count):
        k = KEPT + i
        for c in range(3):
            rays.origin[c, k] = rays.origin[c, i]
            rays.direction[c, k] = rays.direction[c, i]
        rays.pdf[k], rays.eta[k] = rays.pdf[i], rays.eta[i]
        rays.slot[k] = rays.slot[i]
        hits.t[k], hits.prim[k] = hits.t[i], hits.prim[i]
        hits.u[k], hits.v[k] = hits.u[i], hits.v[i]
        hits.instance[k] = hits.instance[i]


@kernel
def _points(scene, work, count, samples):
    """Find the surface points of the kept rays; each gets the throughput 1 / samples."""
    share = np.float32(1.0 / samples)
    for i in range(KEPT, KEPT + count):
        for c in range(3):
            work.rays.throughput[c, i] = share
    group_by_bsdf(scene, work, np.int64(KEPT), count)


@method_kernel
def trace_several(scene, tile, sample, work):
    """Add the samples of one square of a tile to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    count = camera_rays(scene, tile, sample, work, np.int64(0))
    if settings.max_depth < 1:
        return
    intersect(scene.camera_groups, rays, hits, np.int64(0), count, True, None)
    add_emitted_light(scene, work, np.int64(0), count, settings.hide_emitters == 0)
    if settings.max_depth < 2:
        return
    begin_bounce(scene, tile, sample, work, count)
    _keep(rays, hits, count)
    if settings.light_samples > 0:
        _points(scene, work, count, settings.light_samples)
    for number in range(settings.light_samples):
        direct_light(scene, tile, sample, number, work)
    for number in range(settings.bsdf_samples):
        _points(scene, work, count, settings.bsdf_samples)  # emission overwrote the points
        found = scatter(scene, tile, sample, number, work)
        reset_hits(hits, np.int64(0), found)
        intersect(scene.groups, rays, hits, np.int64(0), found, False, None)
        add_emitted_light(scene, work, np.int64(0), found, True)


def _read(properties: Properties) -> Integrator:
    both = properties.has("shading_samples")
    separate = [n for n in ("emitter_samples", "bsdf_samples") if properties.has(n)]
    if both and separate:
        properties.fail(
            separate[0], 'a value together with "shading_samples"', "one of the two"
        )
    shared = properties.integer("shading_samples", 1, at_least=1, at_most=MOST)
    lights, directions = (
        properties.integer(name, shared, at_least=0, at_most=MOST)
        for name in ("emitter_samples", "bsdf_samples")
    )
    if lights == directions == 0:
        properties.fail(
            "bsdf_samples", '0 together with "emitter_samples" 0', "1 or more of either"
        )
    return Integrator(
        "direct",
        max_depth=2,
        hide_emitters=properties.boolean("hide_emitters", False),
        emitter_samples=lights,
        bsdf_samples=directions,
    )


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    say("method", "direct, as requested")
    decision = decide_direct(case, min(case.depth, 2))
    lights, directions = decision.light_samples, decision.bsdf_samples
    if max(lights, directions) > 1:
        whose = "each light" if decision.every_light else "one light at a time"
        say("samples", f"at each point {lights} of {whose} and {directions} of the BSDF")
    elif max(case.requested.emitter_samples, case.requested.bsdf_samples) > 1:
        say("left out", "more samples at each point: no light has an extent")
    return decision


INTEGRATOR = IntegratorKind(
    "light that comes to a surface straight from a light source (Appel 1968)",
    trace_paths,
    _decide,
    _read,
    sees_lights=True,
    scatters=True,
    trace_several=trace_several,
)
