"""Path tracing [Kajiya1986]: the rendering equation by Monte Carlo.

Direct light alone [Appel1968] is the same loop with two segments: camera to surface and
surface to light.
"""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.replay.draws import draw_bounce
from renderer.stages.camera_rays import camera_rays
from renderer.stages.intersect import intersect, reset_hits, seen_by_camera
from renderer.stages.shade import arrive, group_by_bsdf, light_diffuse, scatter


@kernel
def trace_paths(scene, tile, sample, work):
    """Add one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    if settings.max_depth < 1:
        return
    count = camera_rays(
        scene.camera, scene.sampler, scene.replayed, tile, sample, rays, hits
    )
    seen = seen_by_camera(scene.camera_accelerators, scene.accelerators)
    intersect(seen, rays, hits, 0, count, True, None)
    bounce = np.int64(0)  # a literal would compile every stage twice
    while count > 0:
        arrive(scene, work, 0, count, bounce > 0 or settings.hide_emitters == 0)
        if bounce + 1 >= settings.max_depth:
            break
        draw_bounce(scene.sampler, scene.shape, tile, sample, rays, hits, count)
        groups = group_by_bsdf(scene, work, 0, count)
        light_diffuse(
            scene.bsdfs.diffuse, scene.lights, scene, tile, sample, bounce, work, groups[0]
        )
        count = scatter(scene, tile, sample, bounce, work, groups)
        reset_hits(hits, 0, count)
        intersect(scene.accelerators, rays, hits, 0, count, False, None)
        bounce += 1
