"""The stages of `trace_paths` one by one, callable from Python, for `step_by_step`."""

from __future__ import annotations

import numpy as np

from renderer.integrators.path import begin_bounce
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.direct_light import (
    cast_shadow_rays,
    lights_asked,
    sample_lights,
)
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import intersect, reset_hits, trace_shadow_rays
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.scatter import scatter
from renderer.integrators.stages.surface import append_hits, surface_points
from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.kernel_scene import ANY


@entry_kernel
def camera_ray_step(scene, tile, sample, work):
    """Put the camera rays of a tile into `work.rays`; return how many."""
    return camera_rays(scene, tile, sample, work)


@entry_kernel
def first_hit_step(scene, work, count):
    """Intersect the first `count` rays as camera rays."""
    none = np.int64(0)
    intersect(scene.camera_groups, work.rays, work.hits, none, count, True, None)


@entry_kernel
def next_hit_step(scene, work, count):
    """Intersect the first `count` rays as those of any later bounce."""
    reset_hits(work.hits, np.int64(0), count)
    intersect(scene.groups, work.rays, work.hits, np.int64(0), count, False, None)


@entry_kernel
def locate_step(scene, work, count):
    """Fill `work.points` with all hits."""
    rays, hits, order, points = work.rays, work.hits, work.order, work.points
    none = np.int64(0)
    found = append_hits(scene, rays, hits, none, count, ANY, order, points, none)
    surface_points(scene, rays, hits, order, found, points)


@entry_kernel
def arrive_step(scene, bounce, work, count):
    """Add the light of what the rays have hit to `work.radiance`."""
    see_sky = bounce > 0 or scene.settings.hide_emitters == 0
    add_emitted_light(scene, work, np.int64(0), count, see_sky)


@entry_kernel
def draw_step(scene, tile, sample, work, count):
    """Draw a replay's numbers of this bounce; for other samplers nothing."""
    begin_bounce(scene, tile, sample, work, count)


@entry_kernel
def group_step(scene, work, count):
    """Fill `work.points`, grouped by BSDF; return how many have a smooth one."""
    group_by_bsdf(scene, work, np.int64(0), count)
    return work.ends[scene.bsdfs.smooth]


@entry_kernel
def light_count(scene):
    """Return how many lights are sampled at each point."""
    return lights_asked(scene.lights, scene.settings)


@entry_kernel
def light_step(scene, turn, tile, sample, bounce, work, count):
    """Sample a light at the first points, into `work.light_samples`."""
    sample_lights(scene, turn, tile, sample, bounce, work, count)


@entry_kernel
def shadow_ray_step(scene, bounce, work):
    """Cast the shadow rays of the lights just sampled; return how many."""
    cast = cast_shadow_rays(scene, work)
    coherent = bounce == 0
    trace_shadow_rays(scene.shadow_groups, work.shadow_rays, cast, coherent, work.radiance)
    return cast


@entry_kernel
def scatter_step(scene, tile, sample, bounce, work):
    """Put the next rays into `work.rays`; return how many go on."""
    return scatter(scene, tile, sample, bounce, work)
