"""Direct light with several samples at each point: first of the lights, then of the BSDF.

Each way to find light is divided by its number of samples, and their densities count as
often as they are drawn from [Veach1997, section 9.2.2]. With one sample of each it is the
loop of `path`, which is what then runs.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.path import begin_bounce
from renderer.jit import kernel
from renderer.records.batch import CAPACITY
from renderer.stages.camera_rays import camera_rays
from renderer.stages.direct_light import direct_light
from renderer.stages.emission import arrive
from renderer.stages.intersect import intersect, reset_hits
from renderer.stages.materials import group_by_bsdf
from renderer.stages.scatter import scatter

KEPT = CAPACITY + 64  # where the camera's rays are kept while others are traced


@kernel
def _keep(rays, hits, count):
    """Copy `count` rays and their hits behind those that are to be scattered."""
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
    """Find the surface points of the kept rays; each counts for one of so many samples."""
    share = np.float32(1.0 / samples)
    for i in range(KEPT, KEPT + count):
        for c in range(3):
            work.rays.throughput[c, i] = share
    group_by_bsdf(scene, work, np.int64(KEPT), count)


@kernel
def trace_direct_samples(scene, tile, sample, work):
    """Add one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    if settings.max_depth < 1:
        return
    count = camera_rays(scene, tile, sample, work)
    intersect(scene.camera_groups, rays, hits, np.int64(0), count, True, None)
    arrive(scene, work, np.int64(0), count, settings.hide_emitters == 0)
    if settings.max_depth < 2:
        return
    begin_bounce(scene, tile, sample, work, count)
    _keep(rays, hits, count)
    _points(scene, work, count, settings.light_samples)
    for number in range(settings.light_samples):
        direct_light(scene, tile, sample, number, work)
    for number in range(settings.bsdf_samples):
        _points(scene, work, count, settings.bsdf_samples)  # arriving needs their place
        found = scatter(scene, tile, sample, number, work)
        reset_hits(hits, np.int64(0), found)
        intersect(scene.groups, rays, hits, np.int64(0), found, False, None)
        arrive(scene, work, np.int64(0), found, True)
