"""What all integrators share of a bounce: emission found, hits grouped, lights asked."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import CONDUCTOR, DIELECTRIC, DIFFUSE, EMIT
from renderer.lights.choose import lights_asked
from renderer.replay.new_rays import rays_as_mitsuba_rounds
from renderer.stages.direct_light import direct_light
from renderer.stages.emission import add_emission, add_environment
from renderer.stages.intersect import collect, trace_shadow_rays
from renderer.stages.scatter import (
    scatter_conductor,
    scatter_dielectric,
    scatter_diffuse,
)
from renderer.stages.surface import surface_points


@kernel
def _areas_of(lights):
    return None if lights is None else lights.areas


@kernel
def _constants_of(lights):
    return None if lights is None else lights.constants


@kernel
def _arrive_at_lights(scene, areas, work, first, count):
    if areas is None:
        return
    found = collect(scene.stages, work.hits, first, count, EMIT, work.order, 0)
    surface_points(scene, work.rays, work.hits, work.order, found, work.points)
    add_emission(scene, scene.lights, areas, work.points, found, work.radiance)


@kernel
def arrive(scene, work, first, count, see_environment):
    """Add what the paths find where they arrive: area lights, the environment."""
    lights = scene.lights
    _arrive_at_lights(scene, _areas_of(lights), work, first, count)
    if see_environment:
        add_environment(
            scene.settings,
            lights,
            _constants_of(lights),
            work.rays,
            work.hits,
            first,
            count,
            work.radiance,
        )


@kernel
def _collect_kind(table, stages, hits, first, count, kind, order, end):
    if table is None:
        return end
    return collect(stages, hits, first, count, kind, order, end)


@kernel
def group_by_bsdf(scene, work, first, count):
    """Fill `work.points`, grouped by BSDF; return where each of the three groups ends."""
    bsdfs, stages, hits, order = scene.bsdfs, scene.stages, work.hits, work.order
    diffuse = _collect_kind(
        bsdfs.diffuse, stages, hits, first, count, DIFFUSE, order, np.int64(0)
    )
    conductor = _collect_kind(
        bsdfs.conductor, stages, hits, first, count, CONDUCTOR, order, diffuse
    )
    dielectric = _collect_kind(
        bsdfs.dielectric, stages, hits, first, count, DIELECTRIC, order, conductor
    )
    surface_points(scene, work.rays, work.hits, work.order, dielectric, work.points)
    return diffuse, conductor, dielectric


@kernel
def light_diffuse(diffuse, lights, scene, tile, sample, bounce, work, stop):
    """Add the direct light at the diffuse points, which are the first `stop`.

    `diffuse` and `lights` are the scene's, which may have none.
    """
    if diffuse is None:
        return
    if lights is None:
        return
    rays = work.shadow_rays
    for turn in range(lights_asked(lights, scene.settings.every_light)):
        cast = direct_light(
            scene, lights, turn, tile, sample, bounce, work.points, stop, rays
        )
        trace_shadow_rays(scene.accelerators, rays, cast, bounce == 0, work.radiance)


@kernel
def _if_followed(follow, diffuse):
    return None if follow is None else diffuse


@kernel
def scatter(scene, tile, sample, bounce, work, groups):
    """Send the paths on from their surface points; return how many go on."""
    sampler, settings, bsdfs = scene.sampler, scene.settings, scene.bsdfs
    shapes, kinds, points, rays = scene.shapes, bsdfs.kind, work.points, work.rays
    diffuse_end, conductor_end, dielectric_end = groups
    diffuse = _if_followed(settings.follow, bsdfs.diffuse)
    end = np.int64(0)
    end = scatter_diffuse(
        diffuse, sampler, settings, shapes, kinds, tile, sample, bounce, points,
        np.int64(0), diffuse_end, rays, end,
    )  # fmt: skip
    end = scatter_conductor(
        bsdfs.conductor, sampler, settings, shapes, kinds, tile, sample, bounce, points,
        diffuse_end, conductor_end, rays, end,
    )  # fmt: skip
    end = scatter_dielectric(
        bsdfs.dielectric, sampler, settings, shapes, kinds, tile, sample, bounce, points,
        conductor_end, dielectric_end, rays, end,
    )  # fmt: skip
    rays_as_mitsuba_rounds(scene.replayed, settings, shapes, bsdfs, rays, end, points)
    return end
