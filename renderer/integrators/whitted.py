"""Recursive ray tracing [Whitted1980]: reflected and refracted rays are both followed.

The tree of rays is a queue of weighted rays through the same stages. Each depth has a
region of the ray arrays of its own; the deepest region goes first, a batch at a time, so
that the queue stays short however many branches the tree has.
"""

from __future__ import annotations

import numpy as np

from renderer.batch import CAPACITY
from renderer.jit import kernel
from renderer.stages.camera_rays import camera_rays
from renderer.stages.intersect import intersect, reset_hits, seen_by_camera
from renderer.stages.scatter import scatter_conductor, split_dielectric
from renderer.stages.shade import arrive, group_by_bsdf, light_diffuse

REGION = 2 * CAPACITY + 64  # a batch of rays has at most two children each


@kernel
def trace_ray_trees(scene, tile, sample, work):
    """Add one sample of each pixel of a tile to `work.radiance`."""
    rays, hits, settings, bsdfs = work.rays, work.hits, scene.settings, scene.bsdfs
    shapes, points = scene.shapes, work.points
    if settings.max_depth < 1:
        return
    waiting = work.waiting
    waiting[0] = camera_rays(
        scene.camera, scene.sampler, scene.replayed, tile, sample, rays, hits
    )
    seen = seen_by_camera(scene.camera_accelerators, scene.accelerators)
    intersect(seen, rays, hits, 0, waiting[0], True, None)
    depth = np.int64(0)
    while depth >= 0:
        if waiting[depth] == 0:
            depth -= 1
            continue
        count = min(waiting[depth], CAPACITY)
        waiting[depth] -= count
        first = depth * REGION + waiting[depth]
        if depth > 0:
            reset_hits(hits, first, count)
            intersect(scene.accelerators, rays, hits, first, count, False, None)
        arrive(scene, work, first, count, depth > 0 or settings.hide_emitters == 0)
        if depth + 1 >= settings.max_depth:
            continue
        groups = group_by_bsdf(scene, work, first, count)
        light_diffuse(
            bsdfs.diffuse, scene.lights, scene, tile, sample, depth, work, groups[0]
        )
        start = (depth + 1) * REGION
        end = scatter_conductor(
            bsdfs.conductor, scene.sampler, settings, shapes, bsdfs.kind, tile, sample,
            depth, points, groups[0], groups[1], rays, start,
        )  # fmt: skip
        end = split_dielectric(
            bsdfs.dielectric, settings, shapes, bsdfs.kind, points, groups[1], groups[2],
            rays, end,
        )  # fmt: skip
        waiting[depth + 1] = end - start
        depth += 1
