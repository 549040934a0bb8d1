"""Stage 5 with panes of glass: light samples are refracted by the panes.

Glass blocks shadow rays. Without this stage a lamp behind a pane is found by BSDF samples
only, and a small lamp by few of them, with much noise. Here a light sample whose straight
line crosses a pane gives the direction of a ray. That ray is traced and refracted at every
pane that it hits. Its contribution counts if it reaches the light that was sampled.

BSDF samples and light samples are combined by multiple importance sampling [Veach1997,
section 9.2]. The density of a path x, panes, light is the density of its direction at x
times the probabilities of its refractions. Both techniques share the latter, so the weight
depends on x and the direction only. The light is the first one on the straight line from x
when all else is removed. The path of a BSDF sample keeps its weight while panes refract
it. If it is reflected, or ends at another light, no light sample could have found it, and
the weight is 1.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.direct_light import (
    cast_shadow_rays,
    sample_lights,
    shadow_rays_to,
)
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.intersect import (
    intersect,
    reset_hits,
    trace_shadow_rays,
)
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.media_shadows import MOST_SURFACES
from renderer.integrators.stages.scatter import scatter_by
from renderer.integrators.stages.surface import append_hits, surface_points
from renderer.kernels.jit import call, kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
    splat_i32,
)
from renderer.kernels.lanes.memory import append_row, load_row, store_row
from renderer.kernels.lanes.vectors import append3, column, dot, load3
from renderer.kernels.records.batch import NO_AIM, SKY_AIM, with_rays_and_points
from renderer.kernels.records.kernel_scene import (
    ANY_SINGLE,
    EMIT,
    ENVIRONMENT,
    LAMP_DENSITY,
    RECORD,
    SKY_DENSITY,
    WEIGH_FOUND,
)
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE, ON_THE_WAY

NO_ROULETTE = -1  # a bounce before the first, at which roulette never begins


@kernel
def _is_pane(scene, prim):
    return scene.shapes.pane[scene.primitives.shape[prim]] != 0


@kernel
def _light_of(scene, prim):
    """Return the light of a hit primitive, or `SKY_AIM` for a miss."""
    return SKY_AIM if prim < 0 else scene.shapes.light[scene.primitives.shape[prim]]


@kernel
def _is_refracted(points, i, direction):
    normal = column(points.normal, i)
    return dot(direction, normal) * dot(column(points.wo, i), normal) < 0.0


# -------------------------------------------------------------------- paths of BSDF samples


@kernel
def begin_paths(work, count):
    """Reset the aim of `count` camera rays to `NO_AIM`."""
    for k in range(count):
        work.panes.aim[work.rays.slot[k]] = NO_AIM


@kernel
def keep_aims(scene, work, count):
    """Reset the aim of those of `count` paths that no pane has just refracted."""
    rays, points, aim = work.rays, work.points, work.panes.aim
    for k in range(count):
        i = np.int64(rays.point[k])
        if not _is_pane(scene, points.prim[i]) or not _is_refracted(
            points, i, column(rays.direction, k)
        ):
            aim[rays.slot[k]] = NO_AIM


@kernel
def aim_paths(scene, work, count):
    """Find the aim and the MIS weight of paths that hit a pane after a smooth lobe."""
    rays, hits, state = work.rays, work.hits, work.panes
    ahead, found = state.rays, np.int64(0)
    for k in range(count):
        if rays.pdf[k] > 0.0 and hits.prim[k] >= 0 and _is_pane(scene, hits.prim[k]):
            for c in range(3):
                ahead.origin[c, found] = rays.origin[c, k]
                ahead.direction[c, found] = rays.direction[c, k]
            ahead.pdf[found], ahead.slot[found] = rays.pdf[k], rays.slot[k]
            ahead.point[found] = rays.point[k]
            found += 1
    if found == 0:
        return
    _find_densities(scene, work, found)
    for k in range(found):
        if state.density[0, k] > 0.0:
            ratio = state.density[0, k] / ahead.pdf[k]
            state.aim[ahead.slot[k]] = _light_of(scene, state.hits.prim[k])
            state.share[ahead.slot[k]] = 1.0 / (1.0 + ratio * ratio)


@kernel
def _find_densities(scene, work, count):
    """Find the first lights along `work.panes.rays`, and the light-sample densities.

    `density[0]` is indexed by ray, `density[1]` by surface point. It is 0 where a lamp does
    not emit, and where there is no light on the ray.
    """
    lights, settings, state = scene.lights, scene.settings, work.panes
    rays, hits, points, order = state.rays, state.hits, state.points, state.order
    density, zero = state.density, np.int64(0)
    reset_hits(hits, zero, count)
    intersect(scene.lamp_groups, rays, hits, zero, count, False, None)
    if lights.choice.shape[0] != 0 and lights.choice[0, WEIGH_FOUND] != 0:
        call(
            lights.choice[0, WEIGH_FOUND],
            lights.choice[0, RECORD],
            (scene.shapes, scene.primitives.shape, work.points, rays, hits, zero, count),
        )
    for k in range(count):
        density[0, k] = density[1, k] = 0.0
    met = append_hits(scene, rays, hits, zero, count, np.int64(EMIT), order, points, zero)
    if met > 0:
        surface_points(scene, rays, hits, order, met, points)
    for kind in range(lights.methods.shape[0]):
        methods = lights.methods
        if methods[kind, LAMP_DENSITY] != 0 and met > 0:
            call(
                methods[kind, LAMP_DENSITY],
                methods[kind, RECORD],
                (settings, lights, scene.shapes, points, met, density),
            )
        if methods[kind, SKY_DENSITY] != 0:
            call(
                methods[kind, SKY_DENSITY],
                methods[kind, RECORD],
                (settings, lights, work.points, rays, hits, count, density),
            )
    for i in range(met):
        density[0, order[i]] = density[1, i]


@kernel
def add_light_of_paths(scene, work, count, see_sky):
    """Add emission with MIS weights for light behind panes, as `add_emitted_light`."""
    rays, hits, state = work.rays, work.hits, work.panes
    weighed, kept = np.int64(0), state.rays.throughput
    for k in range(count):
        slot = rays.slot[k]
        aim = state.aim[slot]
        if aim != NO_AIM and rays.pdf[k] == 0.0 and _light_of(scene, hits.prim[k]) == aim:
            state.order[weighed] = k
            for c in range(3):
                kept[c, weighed] = rays.throughput[c, k]
                rays.throughput[c, k] *= state.share[slot]
            weighed += 1
    add_emitted_light(scene, work, np.int64(0), count, see_sky)
    for j in range(weighed):
        for c in range(3):
            rays.throughput[c, state.order[j]] = kept[c, j]


# ------------------------------------------------------------------------ light samples


@kernel
def light_through_panes(scene, tile, sample, bounce, work):
    """Add the direct light, also through panes; one light is sampled at each point."""
    count = work.ends[scene.bsdfs.smooth]
    if count == 0:
        return
    samples, crosses = work.light_samples, work.panes.crosses
    sample_lights(scene, np.int64(0), tile, sample, bounce, work, count)
    crossing = _find_crossings(scene, work, count)
    for i in range(count):
        for c in range(3):
            if crosses[i] != 0:
                samples.radiance[c, i] = 0.0
    cast = cast_shadow_rays(scene, work)
    coherent = bounce == 0
    trace_shadow_rays(scene.shadow_groups, work.shadow_rays, cast, coherent, work.radiance)
    if crossing == 0:
        return
    for i in range(count):
        inverse = np.float32(0.0)
        if crosses[i] != 0:
            inverse = np.float32(1.0) / samples.pdf[i]
        for c in range(3):
            samples.radiance[c, i] = inverse
    cast = cast_shadow_rays(scene, work)
    count = _aim_samples(scene, work, cast)
    _trace(scene, tile, sample, bounce, work, count)


@kernel
def _find_crossings(scene, work, count):
    """Mark the points with a pane between them and their light sample; return how many."""
    points, samples, state = work.points, work.light_samples, work.panes
    shadow, order, cast = work.shadow_rays, work.panes.order, np.int64(0)
    for i in range(0, count, 16):
        store_row(state.crosses, 0, i, splat_i32(0))
        lit = first_lanes(count - i) & (load_row(points.bsdf, 0, i) >= 0)
        lit = lit & (load_row(samples.pdf, 0, i) > 0.0)
        wi, r = load3(samples.wi, i), load_row(samples.distance, 0, i)
        origin, direction, distance = shadow_rays_to(points, i, wi, r)
        append3(shadow.origin, cast, origin, lit)
        append3(shadow.direction, cast, direction, lit)
        append_row(
            shadow.t_max, 0, cast, distance * np.float32(scene.settings.before_light), lit
        )
        append_row(order, 0, cast, lane_index() + np.int32(i), lit)
        cast += popcount(mask_bits(lit))
    for i in range(0, cast, 16):
        store_row(shadow.blocked, 0, i, splat_i32(0))
    groups = scene.pane_groups
    for k in range(groups.shape[0]):
        call(groups[k, ANY_SINGLE], groups[k, RECORD], (shadow, cast, None))
    lights, crossing = scene.lights, np.int64(0)
    for j in range(cast):
        if shadow.blocked[j] != 0:
            i, light = order[j], samples.light[order[j]]
            if lights.methods[lights.kind[light], ENVIRONMENT] != 0:
                light = SKY_AIM
            state.crosses[i], state.sampled[points.slot[i]] = 1, light
            crossing += 1
    return crossing


@kernel
def _aim_samples(scene, work, cast):
    """Turn shadow rays into rays if their light is the first one; return how many."""
    shadow, state = work.shadow_rays, work.panes
    rays, hits = state.rays, state.hits
    for k in range(cast):
        for c in range(3):
            rays.origin[c, k] = shadow.origin[c, k]
            rays.direction[c, k] = shadow.direction[c, k]
            rays.throughput[c, k] = shadow.radiance[c, k]
        rays.slot[k], rays.pdf[k] = shadow.slot[k], 0.0
    _find_densities(scene, work, cast)
    count = np.int64(0)
    for k in range(cast):
        if (
            state.density[0, k] > 0.0
            and hits.t[k] >= shadow.t_max[k]
            and _light_of(scene, hits.prim[k]) == state.sampled[shadow.slot[k]]
        ):
            count = _keep_ray(rays, k, count)
    return count


@kernel
def _keep_ray(rays, k, count):
    """Move ray k to index `count`, behind the kept rays; return count + 1."""
    for c in range(3):
        rays.origin[c, count] = rays.origin[c, k]
        rays.direction[c, count] = rays.direction[c, k]
        rays.throughput[c, count] = rays.throughput[c, k]
    rays.slot[count] = rays.slot[k]
    return count + 1


@kernel
def _trace(scene, tile, sample, bounce, work, count):
    """Trace `count` rays of light samples through panes; add the light they reach."""
    state = work.panes
    rays, hits, points = state.rays, state.hits, state.points
    walk = with_rays_and_points(work, rays, hits, points, state.order, state.ends)
    zero, surfaces = np.int64(0), np.int64(0)
    while count > 0 and surfaces < MOST_SURFACES:
        reset_hits(hits, zero, count)
        intersect(scene.groups, rays, hits, zero, count, False, None)
        if surfaces > 0:
            _add_aimed(scene, walk, count)
        surfaces += 1
        if bounce + 2 + surfaces > scene.settings.max_depth:
            break
        for k in range(count):
            if hits.prim[k] >= 0 and not _is_pane(scene, hits.prim[k]):
                hits.prim[k] = -1
        group_by_bsdf(scene, walk, zero, count)
        block = ON_THE_WAY + bounce * BLOCKS_PER_BOUNCE + surfaces
        end = scatter_by(scene, tile, sample, block, np.int64(NO_ROULETTE), walk)
        count = zero
        for k in range(end):
            if _is_refracted(points, np.int64(rays.point[k]), column(rays.direction, k)):
                count = _keep_ray(rays, k, count)


@kernel
def _add_aimed(scene, walk, count):
    """Add the emission of the rays that have reached their sampled light."""
    rays, hits = walk.rays, walk.hits
    for k in range(count):
        if _light_of(scene, hits.prim[k]) != walk.panes.sampled[rays.slot[k]]:
            if hits.prim[k] < 0 or not _is_pane(scene, hits.prim[k]):
                for c in range(3):
                    rays.throughput[c, k] = 0.0
    add_emitted_light(scene, walk, np.int64(0), count, True)
