"""The loop of Mitsuba's `volpath` and `volpathmis`: our stages, Mitsuba's random numbers.

Order of the numbers (Mitsuba, src/integrators/volpath.cpp):

- the film position, and the lens position if there is a lens;
- the colour channel that determines distances;
- per segment, one for the roulette. In a medium, one for the distance and one for the type
  of collision, until it is no null collision;
- at a surface with a smooth lobe, and at a collision, also without media in the scene: two
  for a light sample, one for each tentative collision of the shadow ray, and two and one
  for the BSDF or the phase function.

`volpathmis` has the same order, with other weights (`replay.media.spectral_mis`). There a
path of throughput 0 draws one more number, for the roulette, before it ends.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.direct_light import (
    cast_shadow_rays,
    sample_lights,
    samples_lights,
    shadow_rays_to,
)
from renderer.integrators.stages.intersect import camera_hits, intersect, reset_hits
from renderer.integrators.stages.materials import group_by_bsdf
from renderer.integrators.stages.media import (
    append_scattered,
    begin_in_medium,
    hide_lamps,
    leave_surfaces,
    medium_behind,
)
from renderer.integrators.stages.media_shadows import (
    MOST_SURFACES,
    keep_surfaces,
    pass_surfaces,
)
from renderer.integrators.stages.scatter import scatter
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    mask_bits,
    popcount,
    select,
    splat_f32,
)
from renderer.kernels.lanes.memory import append_row, gather_row, load_row
from renderer.kernels.lanes.vectors import append3, column, dot, load3
from renderer.kernels.records.batch import with_rays_and_points
from renderer.kernels.records.media import VACUUM
from renderer.plugins.lights.kind import add_lanes
from renderer.plugins.media.phase_functions import eval_phase
from renderer.replay.media.carried import (
    add_found_light,
    begin_path,
    begin_shadow_ray,
    cast_collisions,
    note_scattered,
    passed_to_light,
    throughput_to_light,
)
from renderer.replay.media.flight import attenuate_in_order, fly_in_order
from renderer.replay.media.phases import sample_phase_in_order
from renderer.replay.media.record import (
    PASSED,
    TO_DO,
    draw_channel,
    draw_direction,
    draw_light,
    nothing_passes,
    own_sphere_sample,
    pixel_of,
    pixels_of,
    sees_own_plane,
)
from renderer.replay.sequences import BSDF, BSDF_CHOICE

# value of `bounce` for `scatter`: the roulette was played before the flight
_NO_ROULETTE = np.int64(-1)
_NO_LAST = np.int64(1 << 30)  # of a depth: paths end before the flight
_INFINITE = np.float32(np.inf)


@method_kernel
def trace_in_order(order, tile, sample, work):
    """Trace as `integrators.volpath.trace_paths`, with the numbers in Mitsuba's order."""
    count = camera_hits(order.scene, tile, sample, work)
    begin_paths(order, tile, sample, work, count)
    while count > 0:
        count, collisions = fly_in_order(order, tile, sample, work, count)
        add_found_light(order.carry, order.scene, tile, work, count)
        draw_lights(order, tile, sample, work, count, collisions)
        light_surfaces(order, tile, sample, work)
        light_collisions(order, tile, sample, work, collisions)
        draw_directions(order, tile, sample, work, count, collisions)
        count = scatter_in_order(order, tile, sample, work, collisions)
        next_hits(order.scene, work, count)


@kernel
def begin_paths(order, tile, sample, work, count):
    """Initialise the paths of `count` camera rays, whose hits are known."""
    scene, rays, hits = order.scene, work.rays, work.hits
    begin_in_medium(scene.media, work, count)
    zero = np.int64(0)
    if scene.settings.hide_emitters != 0 and scene.media.camera != VACUUM:
        reset_hits(hits, zero, count)  # Mitsuba hides no lamps in a medium
        intersect(scene.groups, rays, hits, zero, count, False, None)
    for k in range(count):
        draw_channel(order.replay, tile, sample, rays.slot[k])
        begin_path(order.carry, pixel_of(tile, rays.slot[k]))


@kernel
def draw_directions(order, tile, sample, work, count, collisions):
    """Draw the numbers of the BSDFs at `count` hits, and of the phase functions."""
    for k in range(count):
        if work.hits.prim[k] >= 0:
            draw_direction(order.replay, tile, sample, work.rays.slot[k])
    for k in range(collisions):
        draw_direction(order.replay, tile, sample, work.media.collisions.slot[k])


@kernel
def scatter_in_order(order, tile, sample, work, collisions):
    """Scatter paths at surfaces and collisions; return the number of rays."""
    scene, carry, rays = order.scene, order.carry, work.rays
    count = scatter(scene, tile, sample, _NO_ROULETTE, work)
    note_scattered(carry, tile, rays, np.int64(0), count)
    first = leave_surfaces(scene, work, count, _NO_LAST)
    count = _scatter_collisions(order, tile, work, collisions, first)
    note_scattered(carry, tile, rays, first, count)
    return count


@kernel
def next_hits(scene, work, count):
    """Find the nearest hits of `count` scattered rays."""
    reset_hits(work.hits, np.int64(0), count)
    intersect(scene.groups, work.rays, work.hits, np.int64(0), count, False, None)
    if scene.settings.hide_emitters != 0:
        hide_lamps(scene, work, count, False)


# --------------------------------------------------------------------------------- lights


@kernel
def draw_lights(order, tile, sample, work, count, collisions):
    """Group hits by BSDF; draw numbers of light samples for smooth ones and collisions."""
    scene, replay, state = order.scene, order.replay, work.media
    group_by_bsdf(scene, work, np.int64(0), count)
    rays, hits, points = work.rays, work.hits, state.collisions
    last = scene.settings.max_depth - 1
    for k in range(count):
        if hits.prim[k] < 0:
            continue
        slot, shape = rays.slot[k], scene.primitives.shape[hits.prim[k]]
        nothing_passes(replay, pixel_of(tile, slot))
        if replay.smooth[shape] == 1 and state.depth[slot] < last:
            draw_light(replay, tile, sample, slot)
    for k in range(collisions):
        slot = points.slot[k]
        nothing_passes(replay, pixel_of(tile, slot))
        if order.lit[points.bsdf[k]] == 1:
            draw_light(replay, tile, sample, slot)


@kernel
def _wanted(order, tile, samples, slot, i, valid):
    """Return the lanes whose light samples Mitsuba traces a shadow ray for.

    These are all with a nonzero density, even if the light or the BSDF is black. In the
    plane of a lamp the density is infinite, for which Mitsuba sets 0.
    """
    light, radiance = load_row(samples.light, 0, i), load3(samples.radiance, i)
    some = fabs(radiance.x) + fabs(radiance.y) + fabs(radiance.z) > 0.0
    pdf = load_row(samples.pdf, 0, i)
    some = some | ((pdf > 0.0) & (pdf < _INFINITE))
    some = some | (gather_row(order.delta, 0, light, valid) != 0)
    pixel = pixels_of(tile, slot)
    return valid & some & (gather_row(order.replay.numbers, PASSED, pixel, valid) == TO_DO)


@kernel
def _round_own_samples(order, tile, work, points, count):
    """Round the samples of lights at points on them: rounding decides on their draws.

    The transmittance is 0 where Mitsuba's density is 0. The sample adds no light.
    """
    samples, numbers = work.light_samples, work.numbers
    for i in range(count):
        light = samples.light[i]
        if order.scene.shapes.light[points.shape[i]] != light:
            continue
        pixel, place = pixel_of(tile, points.slot[i]), column(points.position, i)
        if sees_own_plane(order, light, place, numbers[0, i], numbers[1, i]):
            nothing_passes(order.replay, pixel)
        own, back = own_sphere_sample(order, light, place, numbers[0, i])
        if own:
            distance = np.sqrt((back.x * back.x + back.z * back.z) + back.y * back.y)
            if distance == np.float32(0.0):
                nothing_passes(order.replay, pixel)
                continue
            samples.distance[i] = distance
            samples.wi[0, i] = back.x / distance
            samples.wi[1, i] = back.y / distance
            samples.wi[2, i] = back.z / distance
            for c in range(3):
                samples.radiance[c, i] = np.float32(0.0)


@kernel
def _begin_shadow_rays(order, tile, state, kept, end, at_surfaces):
    """Keep one ray per path of the rays from `kept` to `end`; return the new end.

    A point that is in two groups has two rays, and there is not room for all of them.
    """
    rays = state.rays
    for k in range(kept, end):
        slot = rays.slot[k]
        pixel = pixel_of(tile, slot)
        if order.replay.numbers[PASSED, pixel] != TO_DO:
            continue
        nothing_passes(order.replay, pixel)
        begin_shadow_ray(order.carry, pixel)
        for c in range(3):
            rays.origin[c, kept] = rays.origin[c, k]
            rays.direction[c, kept] = rays.direction[c, k]
            rays.throughput[c, kept] = rays.throughput[c, k]
        medium = state.medium[slot]
        if at_surfaces:
            normal, direction = column(state.normal, slot), column(rays.direction, k)
            media, shape = order.scene.media, state.shape[slot]
            medium = medium_behind(media, shape, normal, direction, medium)
        rays.slot[kept], rays.point[kept] = slot, kept
        state.inside[kept], state.rest[kept] = medium, state.rest[k]
        kept += 1
    return kept


@kernel
def _trace_shadow_rays(order, tile, sample, work, points, count, at_surfaces):
    """Store by pixel the transmittance of the shadow rays of the first `count` points."""
    scene, replay, state = order.scene, order.replay, work.media
    samples, rays, hits = work.light_samples, state.rays, state.hits
    if at_surfaces:
        _round_own_samples(order, tile, work, points, count)
    before_light = np.float32(scene.settings.before_light)
    carry, kept = order.carry, np.int64(0)
    for i in range(0, count, 16):
        slot = load_row(points.slot, 0, i)
        throughput = throughput_to_light(carry, load3(points.throughput, i))
        wanted = _wanted(order, tile, samples, slot, i, first_lanes(count - i))
        wi, distance = load3(samples.wi, i), load_row(samples.distance, 0, i)
        origin = load3(points.position, i)
        if at_surfaces:
            origin, wi, distance = shadow_rays_to(points, i, wi, distance)
        append3(rays.origin, kept, origin, wanted)
        append3(rays.direction, kept, wi, wanted)
        append3(rays.throughput, kept, throughput, wanted)
        append_row(rays.slot, 0, kept, slot, wanted)
        append_row(state.rest, 0, kept, distance * before_light, wanted)
        end = kept + popcount(mask_bits(wanted))
        kept = _begin_shadow_rays(order, tile, state, kept, end, at_surfaces)
    walk = with_rays_and_points(work, rays, hits, state.points, state.order, state.ends)
    surfaces = 0
    while kept > 0 and surfaces < MOST_SURFACES:
        surfaces += 1
        for k in range(kept):
            hits.t[k] = state.rest[rays.point[k]]
            hits.prim[k] = -1
        intersect(scene.groups, rays, hits, np.int64(0), kept, False, None)
        attenuate_in_order(order, tile, sample, work, kept)
        kept = pass_surfaces(scene, walk, kept)
    for i in range(count):  # light samples of density 0
        pixel = pixel_of(tile, points.slot[i])
        if replay.numbers[PASSED, pixel] == TO_DO:
            nothing_passes(replay, pixel)


@kernel
def _add_light(order, tile, work, cast):
    """Add the contributions of `cast` shadow rays, times the transmittance."""
    shadow = work.shadow_rays
    for i in range(0, cast, 16):
        mine, slot = first_lanes(cast - i), load_row(shadow.slot, 0, i)
        ratio, pixel = load_row(shadow.t_max, 0, i), pixels_of(tile, slot)
        passed = passed_to_light(order.carry, pixel, ratio, mine)
        add_lanes(work.radiance, slot, load3(shadow.radiance, i) * passed, mine)


@kernel
def light_surfaces(order, tile, sample, work):
    """Add the direct light at surfaces."""
    scene, points = order.scene, work.points
    count = work.ends[scene.bsdfs.smooth]
    if count == 0 or not samples_lights(scene):
        return
    keep_surfaces(work, count)
    sample_lights(scene, np.int64(0), tile, sample, np.int64(0), work, count)
    _trace_shadow_rays(order, tile, sample, work, points, count, True)
    _add_light(order, tile, work, cast_shadow_rays(scene, work))


@kernel
def light_collisions(order, tile, sample, work, count):
    """Add the direct light at `count` collisions."""
    scene, points = order.scene, work.media.collisions
    if count == 0 or not samples_lights(scene):
        return
    there = with_rays_and_points(work, work.rays, work.hits, points, work.order, work.ends)
    sample_lights(scene, np.int64(0), tile, sample, np.int64(0), there, count)
    _trace_shadow_rays(order, tile, sample, work, points, count, False)
    _add_light(order, tile, work, cast_collisions(order.carry, scene, work, count))


# ---------------------------------------------------------------------------- collisions


@kernel
def _scatter_collisions(order, tile, work, count, end):
    """Sample the phase functions at collisions, append the rays and return the new end."""
    media, replay, rays = order.scene.media, order.replay, work.rays
    points = work.media.collisions
    for i in range(0, count, 16):
        mine = first_lanes(count - i)
        slot, medium = load_row(points.slot, 0, i), load_row(points.bsdf, 0, i)
        pixel, wo = pixels_of(tile, slot), load3(points.wo, i)
        x = gather_row(replay.numbers, BSDF, pixel, mine)
        y = gather_row(replay.numbers, BSDF + 1, pixel, mine)
        choice = gather_row(replay.numbers, BSDF_CHOICE, pixel, mine)
        at = load3(points.position, i)
        direction = sample_phase_in_order(media, medium, at, wo, x, y, choice, mine)
        pdf = eval_phase(media, medium, at, -dot(wo, direction), mine)
        lit = gather_row(order.lit, 0, medium, mine) != 0
        alive, throughput = mine & (pdf > 0.0), load3(points.throughput, i)
        pdf = select(lit, pdf, splat_f32(0.0))  # 0: no light sampling at that event
        end = append_scattered(rays, end, points, i, direction, throughput, pdf, alive)
    return end
