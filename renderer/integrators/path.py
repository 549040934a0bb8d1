"""Path tracing [Kajiya1986]: the rendering equation by Monte Carlo.

Direct light alone [Appel1968] is the same loop with two segments: camera to surface and
surface to light.
"""

from __future__ import annotations

import numpy as np

from renderer.jit import call, kernel
from renderer.records.kernel_scene import BEGIN_BOUNCE, RECORD
from renderer.stages.camera_rays import camera_rays
from renderer.stages.direct_light import direct_light
from renderer.stages.emission import arrive
from renderer.stages.intersect import intersect, reset_hits
from renderer.stages.materials import group_by_bsdf
from renderer.stages.scatter import scatter


@kernel
def begin_bounce(scene, tile, sample, work, count):
    """Let a sampler that draws in order draw what `count` paths need at their hits."""
    sampler = scene.sampler
    if sampler[0, BEGIN_BOUNCE] != 0:
        call(
            sampler[0, BEGIN_BOUNCE],
            sampler[0, RECORD],
            (scene.primitives.shape, tile, sample, work.rays, work.hits, count),
        )


@kernel
def trace_paths(scene, tile, sample, work):
    """Add one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    if settings.max_depth < 1:
        return
    count = camera_rays(scene, tile, sample, work)
    intersect(scene.camera_groups, rays, hits, np.int64(0), count, True, None)
    bounce = np.int64(0)  # a literal would compile every stage twice
    while count > 0:
        see_sky = bounce > 0 or settings.hide_emitters == 0
        arrive(scene, work, np.int64(0), count, see_sky)
        if bounce + 1 >= settings.max_depth:
            break
        begin_bounce(scene, tile, sample, work, count)
        group_by_bsdf(scene, work, np.int64(0), count)
        direct_light(scene, tile, sample, bounce, work)
        count = scatter(scene, tile, sample, bounce, work)
        reset_hits(hits, np.int64(0), count)
        intersect(scene.groups, rays, hits, np.int64(0), count, False, None)
        bounce += 1
