"""Recursive ray tracing [Whitted1980]: reflected and refracted rays are both followed.

The tree of rays is a queue of weighted rays through the same stages. Each depth has a
region of the ray arrays of its own; the deepest region goes first, a batch at a time, so
that the queue stays short however many branches the tree has.
"""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.records.batch import CAPACITY
from renderer.stages.camera_rays import camera_rays
from renderer.stages.direct_light import direct_light
from renderer.stages.emission import arrive
from renderer.stages.intersect import intersect, reset_hits
from renderer.stages.materials import group_by_bsdf
from renderer.stages.split import split

REGION = 2 * CAPACITY + 64  # a batch of rays has at most two children each


@kernel
def trace_ray_trees(scene, tile, sample, work):
    """Add one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, settings = work.rays, work.hits, scene.settings
    if settings.max_depth < 1:
        return
    waiting = work.waiting
    waiting[0] = camera_rays(scene, tile, sample, work)
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
        arrive(scene, work, first, count, depth > 0 or settings.hide_emitters == 0)
        if depth + 1 >= settings.max_depth:
            continue
        group_by_bsdf(scene, work, first, count)
        direct_light(scene, tile, sample, depth, work)
        waiting[depth + 1] = split(scene, work, (depth + 1) * REGION)
        depth += 1
