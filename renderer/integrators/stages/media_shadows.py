"""Direct light in participating media: shadow rays are attenuated as well as blocked.

A shadow ray continues through surfaces that transmit light undeflected, and is multiplied
by the transmittance of the media on its way.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.direct_light import (
    cast_shadow_rays,
    is_lit,
    sample_lights,
    samples_lights,
)
from renderer.integrators.stages.intersect import intersect
from renderer.integrators.stages.materials import prepare_bsdfs
from renderer.integrators.stages.media import medium_behind
from renderer.integrators.stages.surface import (
    append_hits,
    leave_surface,
    local_wo,
    surface_points,
)
from renderer.kernels.jit import call, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    mask_bits,
    popcount,
)
from renderer.kernels.lanes.memory import append_row, gather_row, load_row
from renderer.kernels.lanes.vectors import (
    append3,
    column,
    dot,
    load3,
    select3,
    store3,
)
from renderer.kernels.records.batch import with_rays_and_points
from renderer.kernels.records.kernel_scene import (
    DRAW,
    FIRST_BSDF,
    LET_THROUGH,
    RECORD,
)
from renderer.plugins.bsdfs.kind import black, straight_through
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.lights.kind import light_probability, light_sample_weight
from renderer.plugins.media.free_flight import noise_of, transmittance
from renderer.plugins.media.phase_functions import eval_phase
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE, ON_THE_WAY

MOST_SURFACES = 1 << 16  # limit for one shadow ray


@method_kernel
def let_through(bsdf, points, start, stop):
    """Multiply the points' throughput by the straight transmission of one kind of BSDF."""
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        _, wo = local_wo(bsdf, points, i)
        passed = straight_through(parameters_at(bsdf.form, points, i), wo)
        throughput = load3(points.throughput, i)
        store3(points.throughput, i, select3(mine, throughput * passed, throughput))


# ----------------------------------------------------------------------------- the walk


@kernel
def _start(scene, work, cast, at_surfaces):
    """Copy the shadow rays to rays that can pass surfaces; return their number."""
    media, state, shadow = scene.media, work.media, work.shadow_rays
    rays, last = state.rays, scene.settings.max_depth - 1
    count = np.int64(0)
    for k in range(cast):
        slot = shadow.slot[k]
        medium = state.medium[slot]
        if at_surfaces:
            if state.depth[slot] >= last:
                continue
            medium = medium_behind(
                media,
                state.shape[slot],
                column(state.normal, slot),
                column(shadow.direction, k),
                medium,
            )
        state.inside[k], state.rest[k] = medium, shadow.t_max[k]
        for c in range(3):
            rays.origin[c, count] = shadow.origin[c, k]
            rays.direction[c, count] = shadow.direction[c, k]
            rays.throughput[c, count] = shadow.radiance[c, k]
        rays.slot[count], rays.point[count] = slot, k
        count += 1
    return count


@kernel
def _attenuate(scene, work, numbers, count):
    """Multiply the rays' throughput by the transmittance up to their hits."""
    media, state = scene.media, work.media
    rays, hits = state.rays, state.hits
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        medium = gather_row(state.inside, 0, load_row(rays.point, 0, i), valid)
        inside = valid & (medium >= 0)
        if mask_bits(inside) == 0:
            continue
        passed = transmittance(
            media,
            medium,
            load3(rays.origin, i),
            load3(rays.direction, i),
            load_row(hits.t, 0, i),
            noise_of(load_row(numbers, 0, i), load_row(numbers, 1, i)),
            inside,
        )
        throughput = load3(rays.throughput, i)
        store3(rays.throughput, i, select3(inside, throughput * passed, throughput))


@kernel
def _arrive(work, count):
    """Add the radiance of the rays that reach their light without a hit."""
    rays, hits, radiance = work.media.rays, work.media.hits, work.radiance
    for k in range(count):
        if hits.prim[k] < 0:
            for c in range(3):
                radiance[c, rays.slot[k]] += rays.throughput[c, k]


@kernel
def pass_surfaces(scene, walk, count):
    """Continue the rays behind surfaces that transmit light; return how many continue."""
    bsdfs, media, state = scene.bsdfs, scene.media, walk.media
    rays, hits, points = walk.rays, walk.hits, walk.points
    order, ends = walk.order, walk.ends
    first = np.int64(0)
    ends[0] = 0
    for kind in range(bsdfs.methods.shape[0]):
        ends[kind + 1] = ends[kind]
        if bsdfs.methods[kind, LET_THROUGH] != 0:
            stage = FIRST_BSDF << kind
            ends[kind + 1] = append_hits(
                scene, rays, hits, first, count, stage, order, points, ends[kind]
            )
    total = ends[bsdfs.methods.shape[0]]
    if total == 0:
        return total
    surface_points(scene, rays, hits, order, total, points)
    prepare_bsdfs(scene, walk)
    for kind in range(bsdfs.methods.shape[0]):
        if ends[kind + 1] > ends[kind]:
            call(
                bsdfs.methods[kind, LET_THROUGH],
                bsdfs.methods[kind, RECORD],
                (points, ends[kind], ends[kind + 1]),
            )
    for i in range(total):
        k = rays.point[order[i]]
        order[i] = k  # index of the shadow ray instead of the ray
        if points.bsdf[i] < 0:  # the hit is in the list of another kind as well
            continue
        state.rest[k] -= points.t[i]
        state.inside[k] = medium_behind(
            media,
            points.shape[i],
            column(points.normal, i),
            -column(points.wo, i),
            state.inside[k],
        )
    end = first
    for i in range(0, total, 16):
        throughput = load3(points.throughput, i)
        on = first_lanes(total - i) & (load_row(points.bsdf, 0, i) >= 0)
        on = on & is_lit(throughput)
        direction = -load3(points.wo, i)
        append3(rays.origin, end, leave_surface(points, i, direction), on)
        append3(rays.direction, end, direction, on)
        append3(rays.throughput, end, throughput, on)
        append_row(rays.slot, 0, end, load_row(points.slot, 0, i), on)
        append_row(rays.point, 0, end, load_row(order, 0, i), on)
        end += popcount(mask_bits(on))
    return end


@kernel
def _trace(scene, tile, sample, block, work, cast, at_surfaces):
    """Add the radiance of `cast` shadow rays; `block` selects their random numbers."""
    state = work.media
    rays, hits = state.rays, state.hits
    walk = with_rays_and_points(work, rays, hits, state.points, state.order, state.ends)
    count, surfaces = _start(scene, work, cast, at_surfaces), np.int64(0)
    while count > 0 and surfaces < MOST_SURFACES:
        for k in range(count):
            hits.t[k] = state.rest[rays.point[k]]
            hits.prim[k] = -1
        intersect(scene.groups, rays, hits, np.int64(0), count, False, None)
        surfaces += 1
        way = ON_THE_WAY + block + surfaces
        call(
            scene.sampler[0, DRAW],
            scene.sampler[0, RECORD],
            (tile, sample, way, rays.slot, count, work.numbers),
        )
        _attenuate(scene, work, work.numbers, count)
        _arrive(work, count)
        count = pass_surfaces(scene, walk, count)


# -------------------------------------------------------------------------- lit points


@kernel
def keep_surfaces(work, count):
    """Keep the shapes and normals of the first `count` points, indexed by slot."""
    state, points = work.media, work.points
    for i in range(count):
        slot = points.slot[i]
        state.shape[slot] = points.shape[i]
        for c in range(3):
            state.normal[c, slot] = points.normal[c, i]


@kernel
def light_surfaces(scene, tile, sample, step, work):
    """Add the direct light at surface points, as `direct_light` does without media."""
    count = work.ends[scene.bsdfs.smooth]
    if count == 0:
        return
    keep_surfaces(work, count)
    sample_lights(scene, np.int64(0), tile, sample, step, work, count)
    cast = cast_shadow_rays(scene, work)
    _trace(scene, tile, sample, step * BLOCKS_PER_BOUNCE, work, cast, True)


@kernel
def cast_from_collisions(scene, work, count, lamps=None):
    """Append the contributions of light samples at collisions to `work.shadow_rays`.

    With `lamps`, `points.pdf` holds the MIS weights that are not in the throughput yet.
    """
    media, settings, points = scene.media, scene.settings, work.media.collisions
    shadow_rays, samples = work.shadow_rays, work.light_samples
    probability = light_probability(scene.lights, settings)
    before_light = np.float32(settings.before_light)
    cast = np.int64(0)
    for i in range(0, count, 16):
        mine = first_lanes(count - i)
        wi = load3(samples.wi, i)
        medium = load_row(points.bsdf, 0, i)
        at, cosine = load3(points.position, i), -dot(load3(points.wo, i), wi)
        phase = eval_phase(media, medium, at, cosine, mine)
        light_pdf = load_row(samples.pdf, 0, i) * probability
        weight = phase * light_sample_weight(settings, light_pdf, phase) / probability
        if lamps is not None:
            weight = weight * load_row(points.pdf, 0, i)
        carried = load3(points.throughput, i) * load3(samples.radiance, i) * weight
        lit = mine & is_lit(carried)
        append3(shadow_rays.origin, cast, at, lit)
        append3(shadow_rays.direction, cast, wi, lit)
        distance = load_row(samples.distance, 0, i)
        append_row(shadow_rays.t_max, 0, cast, distance * before_light, lit)
        append3(shadow_rays.radiance, cast, select3(lit, carried, black()), lit)
        append_row(shadow_rays.slot, 0, cast, load_row(points.slot, 0, i), lit)
        cast += popcount(mask_bits(lit))
    return cast


@kernel
def light_collisions(scene, tile, sample, step, work, count, turn, lamps):
    """Add the direct light at collisions.

    `turn` is 0 for collisions of free flight, 1 for equiangular points near lamps.
    """
    if count == 0 or not samples_lights(scene):
        return
    there = with_rays_and_points(
        work, work.rays, work.hits, work.media.collisions, work.order, work.ends
    )
    sample_lights(scene, turn, tile, sample, step, there, count)
    cast = cast_from_collisions(scene, work, count, lamps)
    block = step * BLOCKS_PER_BOUNCE + turn * MOST_SURFACES
    _trace(scene, tile, sample, block, work, cast, False)
