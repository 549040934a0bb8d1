"""The stages of `follow_paths` one by one, callable from Python.

`step_by_step` reads the work arrays between them; a study times them.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.path import begin_bounce
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.direct_light import (
    cast_shadow_rays,
    lights_at_a_point,
    sample_lights,
)
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.film import add_to_tile, clear, close_sums, open_sums
from renderer.integrators.stages.intersect import intersect, reset_hits, trace_shadow_rays
from renderer.integrators.stages.materials import (
    list_by_bsdf,
    prepare_bsdfs,
)
from renderer.integrators.stages.scatter import scatter
from renderer.integrators.stages.surface import append_hits, surface_points
from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.batch import has_places
from renderer.kernels.records.kernel_scene import ANY


@entry_kernel
def places_step(tile):
    """Return whether the tile's square has a pixel."""
    return has_places(tile)


@entry_kernel
def camera_ray_step(scene, tile, sample, work, first):
    """Append the camera rays of a tile to `first` rays; return how many there are then."""
    return camera_rays(scene, tile, sample, work, first)


@entry_kernel
def first_hit_step(scene, work, first, count):
    """Intersect `count` rays from `first` on as camera rays."""
    intersect(scene.camera_groups, work.rays, work.hits, first, count, True, None)


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
def list_step(scene, work, count):
    """Fill `work.points` with the surfaces of the hits, grouped by BSDF."""
    list_by_bsdf(scene, work, np.int64(0), count)


@entry_kernel
def prepare_step(scene, work):
    """Look up the parameters of their BSDFs; return how many have a smooth one."""
    prepare_bsdfs(scene, work)
    return work.ends[scene.bsdfs.smooth]


@entry_kernel
def light_count(scene):
    """Return how many lights are sampled at each point."""
    return lights_at_a_point(scene.lights, scene.settings)


@entry_kernel
def light_step(scene, turn, tile, sample, bounce, work, count):
    """Sample a light at the first points, into `work.light_samples`."""
    sample_lights(scene, turn, tile, sample, bounce, work, count)


@entry_kernel
def reflect_step(scene, work):
    """Cast the shadow rays of the lights just sampled; return how many."""
    return cast_shadow_rays(scene, work)


@entry_kernel
def visibility_step(scene, bounce, work, cast):
    """Add to `work.radiance` what the shadow rays carry that nothing blocks."""
    coherent = bounce == 0
    trace_shadow_rays(scene.shadow_groups, work.shadow_rays, cast, coherent, work.radiance)


@entry_kernel
def clear_step(tile, work):
    """Set the light of a tile's slots to zero."""
    clear(work.radiance, tile.level)


@entry_kernel
def film_step(rfilter, tile, work, sums, border):
    """Add the samples of a tile to its sums."""
    open_sums(rfilter, sums, work.splats)
    add_to_tile(rfilter, tile, work.film, work.radiance, sums, work.splats, border)
    close_sums(rfilter, sums, work.splats)


@entry_kernel
def scatter_step(scene, tile, sample, bounce, work):
    """Put the next rays into `work.rays`; return how many go on."""
    return scatter(scene, tile, sample, bounce, work)
