"""The stages of `trace_paths` one by one, callable from Python, for `step_by_step`."""

from __future__ import annotations

import numpy as np

from renderer.jit import entry_kernel
from renderer.kernel_scene import ANY, DIFFUSE
from renderer.lanes.functions import first_lanes, select, splat_f32, to_f32
from renderer.lanes.memory import load_row, store_row
from renderer.lights.choose import (
    choose_light,
    light_probability,
    lights_asked,
    sample_light,
)
from renderer.replay.draws import draw_bounce
from renderer.sampling import BLOCKS_PER_BOUNCE, draw4
from renderer.stages.camera_rays import camera_rays
from renderer.stages.direct_light import direct_light
from renderer.stages.intersect import (
    collect,
    intersect,
    reset_hits,
    seen_by_camera,
    trace_shadow_rays,
)
from renderer.stages.shade import arrive, group_by_bsdf, scatter
from renderer.stages.shading_frame import facing
from renderer.stages.surface import surface_points
from renderer.stages.tile import pixel_key
from renderer.vectors import load3

# rows of what `ask_light` writes
LIGHT, SEEN, WI, DISTANCE, RADIANCE, PDF = 0, 1, 2, 5, 6, 9
ASKED_ROWS = 10


@entry_kernel
def camera_ray_step(scene, tile, sample, work):
    """Put the camera rays of a tile into `work.rays`; return how many."""
    return camera_rays(
        scene.camera, scene.sampler, scene.replayed, tile, sample, work.rays, work.hits
    )


@entry_kernel
def first_hit_step(scene, work, count):
    """Intersect the first `count` rays as camera rays."""
    seen = seen_by_camera(scene.camera_accelerators, scene.accelerators)
    intersect(seen, work.rays, work.hits, 0, count, True, None)


@entry_kernel
def next_hit_step(scene, work, count):
    """Intersect the first `count` rays as those of any later bounce."""
    reset_hits(work.hits, 0, count)
    intersect(scene.accelerators, work.rays, work.hits, 0, count, False, None)


@entry_kernel
def locate_step(scene, work, count):
    """Fill `work.points` with all hits."""
    found = collect(scene.stages, work.hits, 0, count, ANY, work.order, 0)
    surface_points(scene, work.rays, work.hits, work.order, found, work.points)


@entry_kernel
def arrive_step(scene, bounce, work, count):
    """Add the light of what the rays have hit to `work.radiance`."""
    see_environment = bounce > 0 or scene.settings.hide_emitters == 0
    arrive(scene, work, 0, count, see_environment)


@entry_kernel
def draw_step(scene, tile, sample, work, count):
    """Draw a replay's numbers of this bounce; for other samplers nothing."""
    draw_bounce(scene.sampler, scene.shape, tile, sample, work.rays, work.hits, count)


@entry_kernel
def group_step(scene, work, count):
    """Fill `work.points`, grouped by BSDF; return where the three groups end."""
    return group_by_bsdf(scene, work, 0, count)


@entry_kernel
def light_count(lights, settings):
    """Return how many lights are asked at each point."""
    return lights_asked(lights, settings.every_light)


@entry_kernel
def ask_light(scene, lights, turn, tile, sample, bounce, points, answer):
    """Write to `answer` what the light says that `direct_light` asks at point 0."""
    settings = scene.settings
    face = facing(scene.shapes, scene.bsdfs.kind, points, 0, first_lanes(1), DIFFUSE)
    slot = load_row(points.slot, 0, 0)
    block = 2 + bounce * BLOCKS_PER_BOUNCE + turn
    x, y, z, number = draw4(scene.sampler, pixel_key(tile, slot), sample, block)
    light, x = choose_light(lights, settings.every_light, settings.replay, turn, x, number)
    position = load3(points.position, 0)
    asked = sample_light(lights, scene.surfaces, light, position, x, y, z)
    probability = light_probability(lights, settings.every_light)
    seen = select(face.mine, splat_f32(1.0), splat_f32(0.0))
    store_row(answer, LIGHT, 0, to_f32(light))
    store_row(answer, SEEN, 0, seen)
    for k, part in ((0, asked.wi.x), (1, asked.wi.y), (2, asked.wi.z)):
        store_row(answer, WI + k, 0, part)
    store_row(answer, DISTANCE, 0, asked.distance)
    weight = asked.radiance * (np.float32(1.0) / probability)
    for k, part in ((0, weight.x), (1, weight.y), (2, weight.z)):
        store_row(answer, RADIANCE + k, 0, part)
    store_row(answer, PDF, 0, asked.pdf * probability)


@entry_kernel
def shadow_ray_step(scene, lights, turn, tile, sample, bounce, work, stop):
    """Ask one light at the first `stop` points; return the count of shadow rays."""
    rays = work.shadow_rays
    cast = direct_light(scene, lights, turn, tile, sample, bounce, work.points, stop, rays)
    trace_shadow_rays(scene.accelerators, rays, cast, bounce == 0, work.radiance)
    return cast


@entry_kernel
def scatter_step(scene, tile, sample, bounce, work, groups):
    """Put the next rays into `work.rays`; return how many go on."""
    return scatter(scene, tile, sample, bounce, work, groups)
