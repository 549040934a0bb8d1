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
    found = collect(scene, work.hits, first, count, EMIT, work.order, 0)
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
def _collect_kind(table, scene, work, first, count, kind, end):
    if table is None:
        return end
    return collect(scene, work.hits, first, count, kind, work.order, end)


@kernel
def group_by_bsdf(scene, work, first, count):
    """Fill `work.points`, grouped by BSDF; return where each of the three groups ends."""
    bsdfs = scene.bsdfs
    diffuse = _collect_kind(bsdfs.diffuse, scene, work, first, count, DIFFUSE, np.int64(0))
    conductor = _collect_kind(
        bsdfs.conductor, scene, work, first, count, CONDUCTOR, diffuse
    )
    dielectric = _collect_kind(
        bsdfs.dielectric, scene, work, first, count, DIELECTRIC, conductor
    )
    surface_points(scene, work.rays, work.hits, work.order, dielectric, work.points)
    return diffuse, conductor, dielectric


@kernel
def _light_diffuse(diffuse, lights, scene, tile, sample, bounce, work, stop):
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
def light_diffuse(scene, tile, sample, bounce, work, stop):
    """Add the direct light at the diffuse points, which are the first `stop`."""
    diffuse, lights = scene.bsdfs.diffuse, scene.lights
    _light_diffuse(diffuse, lights, scene, tile, sample, bounce, work, stop)


@kernel
def _scatter_diffuse(diffuse, follow, scene, tile, sample, bounce, work, stop, end):
    if diffuse is None:
        return end
    if follow is None:
        return end
    return scatter_diffuse(
        scene, tile, sample, bounce, work.points, 0, stop, work.rays, end
    )


@kernel
def _scatter_conductor(conductor, scene, tile, sample, bounce, work, start, stop, end):
    if conductor is None:
        return end
    return scatter_conductor(
        scene, tile, sample, bounce, work.points, start, stop, work.rays, end
    )


@kernel
def _scatter_dielectric(dielectric, scene, tile, sample, bounce, work, start, stop, end):
    if dielectric is None:
        return end
    return scatter_dielectric(
        scene, tile, sample, bounce, work.points, start, stop, work.rays, end
    )


@kernel
def scatter(scene, tile, sample, bounce, work, groups):
    """Send the paths on from their surface points; return how many go on."""
    bsdfs = scene.bsdfs
    diffuse, conductor, dielectric = groups
    follow = scene.settings.follow
    end = np.int64(0)
    end = _scatter_diffuse(
        bsdfs.diffuse, follow, scene, tile, sample, bounce, work, diffuse, end
    )
    end = _scatter_conductor(
        bsdfs.conductor, scene, tile, sample, bounce, work, diffuse, conductor, end
    )
    end = _scatter_dielectric(
        bsdfs.dielectric, scene, tile, sample, bounce, work, conductor, dielectric, end
    )
    rays_as_mitsuba_rounds(scene.replayed, scene, work.rays, end, work.points)
    return end
