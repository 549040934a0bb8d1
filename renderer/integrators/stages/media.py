"""Participating media: free flight, collisions, and medium boundaries.

A ray that collides before it reaches its surface becomes a point in
`MediaWork.collisions`. There a phase function takes the place of the BSDF.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.intersect import intersect
from renderer.integrators.stages.scatter import largest, survive
from renderer.kernels.jit import call, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    mask_bits,
    maximum,
    popcount,
    select,
    splat_f32,
    splat_i32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import sincos
from renderer.kernels.lanes.memory import append_row, gather_row, load_row
from renderer.kernels.lanes.vectors import (
    append3,
    column,
    dot,
    load3,
    orthonormal_basis,
    select3,
)
from renderer.kernels.records.kernel_scene import DRAW, RECORD
from renderer.kernels.records.media import NO_BOUNDARY
from renderer.plugins.bsdfs.kind import SMOOTH, STRAIGHT
from renderer.plugins.media.equiangular import flight_weight
from renderer.plugins.media.free_flight import free_flight, noise_of
from renderer.plugins.media.phase_functions import eval_phase, sample_phase
from renderer.plugins.sampling.numbers_and_warps import (
    BLOCKS_PER_BOUNCE,
    ON_THE_WAY,
    TWO_PI,
)


@kernel
def begin_in_medium(media, work, count):
    """Set the medium state of `count` camera paths."""
    rays, state = work.rays, work.media
    for k in range(count):
        slot = rays.slot[k]
        state.medium[slot] = media.camera
        state.depth[slot] = 0
        for c in range(3):
            rays.previous[c, k] = rays.origin[c, k]


@kernel
def medium_behind(media, shape, normal, direction, medium):
    """Return the medium of a ray that leaves a surface; all arguments are scalars.

    As in Mitsuba, the last boundary that was crossed decides; there is no stack of media.
    """
    if media.interior[shape] == NO_BOUNDARY:
        return medium
    outward = dot(normal, direction) > np.float32(0.0)
    return media.exterior[shape] if outward else media.interior[shape]


# ---------------------------------------------------------------------------- collisions


@kernel
def keep_rays(rays, hits, i, end, throughput, mask):
    """Move the masked rays of i to i + 15, with their hits, to index `end`."""
    origin, direction = load3(rays.origin, i), load3(rays.direction, i)
    previous = load3(rays.previous, i)
    append3(rays.origin, end, origin, mask)
    append3(rays.direction, end, direction, mask)
    append3(rays.throughput, end, throughput, mask)
    append3(rays.previous, end, previous, mask)
    append_row(rays.pdf, 0, end, load_row(rays.pdf, 0, i), mask)
    append_row(rays.eta, 0, end, load_row(rays.eta, 0, i), mask)
    append_row(rays.slot, 0, end, load_row(rays.slot, 0, i), mask)
    append_row(hits.t, 0, end, load_row(hits.t, 0, i), mask)
    append_row(hits.prim, 0, end, load_row(hits.prim, 0, i), mask)
    append_row(hits.u, 0, end, load_row(hits.u, 0, i), mask)
    append_row(hits.v, 0, end, load_row(hits.v, 0, i), mask)
    append_row(hits.instance, 0, end, load_row(hits.instance, 0, i), mask)


@kernel
def append_collisions(
    points, end, position, direction, throughput, medium, slot, eta, mask
):
    """Append the collisions of the masked lanes to `points`; return the new end."""
    append3(points.position, end, position, mask)
    append3(points.wo, end, -direction, mask)
    append3(points.throughput, end, throughput, mask)
    append_row(points.bsdf, 0, end, medium, mask)
    append_row(points.slot, 0, end, slot, mask)
    append_row(points.eta, 0, end, eta, mask)
    return end + popcount(mask_bits(mask))


@kernel
def append_scattered(rays, end, points, i, direction, throughput, pdf, mask):
    """Append the rays scattered at collisions i to i + 15; return the new end.

    A ray starts at the collision itself; there is no surface to offset it from.
    """
    position = load3(points.position, i)
    append3(rays.origin, end, position, mask)
    append3(rays.previous, end, position, mask)
    append3(rays.direction, end, direction, mask)
    append3(rays.throughput, end, throughput, mask)
    append_row(rays.pdf, 0, end, pdf, mask)
    append_row(rays.eta, 0, end, load_row(points.eta, 0, i), mask)
    append_row(rays.lobe, 0, end, splat_i32(SMOOTH), mask)
    append_row(rays.slot, 0, end, load_row(points.slot, 0, i), mask)
    append_row(rays.point, 0, end, lane_index() + np.int32(i), mask)
    return end + popcount(mask_bits(mask))


@kernel
def fly(scene, tile, sample, step, work, count, lamps):
    """Sample the free flight of `count` rays; return the numbers of hits and collisions.

    Rays that reach their surface are compacted in place, in order. With `lamps`, light
    samples at collisions get MIS weights against the equiangular samples near lamps.
    """
    media, state = scene.media, work.media
    rays, hits, points = work.rays, work.hits, state.collisions
    numbers = work.numbers
    call(
        scene.sampler[0, DRAW],
        scene.sampler[0, RECORD],
        (
            tile,
            sample,
            ON_THE_WAY + step * BLOCKS_PER_BOUNCE,
            rays.slot,
            count,
            numbers,
        ),
    )
    last = scene.settings.max_depth - 1  # depth of the last segment
    hides = scene.settings.hide_emitters != 0
    kept, collisions = np.int64(0), np.int64(0)
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        slot = load_row(rays.slot, 0, i)
        medium = gather_row(state.medium, 0, slot, valid)
        depth = gather_row(state.depth, 0, slot, valid)
        throughput = load3(rays.throughput, i)
        inside = valid & (medium >= 0)
        stays, missed = valid, load_row(hits.prim, 0, i) < 0
        if mask_bits(inside) != 0:
            origin, direction = load3(rays.origin, i), load3(rays.direction, i)
            flight = free_flight(
                media,
                medium,
                origin,
                direction,
                select(missed, splat_f32(np.float32(np.inf)), load_row(hits.t, 0, i)),
                load_row(numbers, 0, i),
                load_row(numbers, 1, i),
                noise_of(load_row(numbers, 2, i), load_row(numbers, 3, i)),
                inside,
            )
            throughput = select3(inside, throughput * flight.weight, throughput)
            alive = fabs(largest(throughput)) > 0.0
            # nothing behind the camera's far plane is seen, as in Mitsuba
            alive = alive & (~flight.collided | (flight.distance <= load_row(hits.t, 0, i)))
            collided = flight.collided & alive & (depth < np.int32(last))
            if lamps is not None:
                t, lit = flight.distance, load_row(state.lit, 0, i)
                weight = flight_weight(
                    media, lamps, medium, origin, direction, t, lit, collided
                )
                append_row(points.pdf, 0, collisions, weight, collided)
            collisions = append_collisions(
                points,
                collisions,
                origin + direction * flight.distance,
                direction,
                throughput,
                medium,
                slot,
                load_row(rays.eta, 0, i),
                collided,
            )
            stays = stays & ~flight.collided & alive
        if hides:  # a hidden environment is hidden through media too
            stays = stays & (~missed | (depth > 0))
        keep_rays(rays, hits, i, kept, throughput, stays)
        kept += popcount(mask_bits(stays))
    return kept, collisions


@kernel
def scatter_collisions(scene, tile, sample, step, work, collisions, end):
    """Sample the phase functions at collisions, append the rays and return the new end."""
    media, state, rays = scene.media, work.media, work.rays
    points, numbers = state.collisions, work.numbers
    call(
        scene.sampler[0, DRAW],
        scene.sampler[0, RECORD],
        (tile, sample, 1 + step * BLOCKS_PER_BOUNCE, points.slot, collisions, numbers),
    )
    for i in range(0, collisions, 16):
        mine = first_lanes(collisions - i)
        medium = load_row(points.bsdf, 0, i)
        at, x = load3(points.position, i), load_row(numbers, 0, i)
        cosine = sample_phase(media, medium, at, x, load_row(numbers, 2, i), mine)
        pdf = eval_phase(media, medium, at, cosine, mine)
        forward = -load3(points.wo, i)
        s, t = orthonormal_basis(forward)
        sin_phi, cos_phi = sincos(load_row(numbers, 1, i) * TWO_PI)
        sine = sqrt(maximum((1.0 - cosine) * (1.0 + cosine), splat_f32(0.0)))
        direction = s * (sine * cos_phi) + t * (sine * sin_phi) + forward * cosine
        throughput, eta = load3(points.throughput, i), load_row(points.eta, 0, i)
        alive, throughput = survive(
            scene.settings,
            step + 1,
            throughput,
            eta,
            load_row(numbers, 3, i),
            mine & (pdf > 0.0),
        )
        end = append_scattered(rays, end, points, i, direction, throughput, pdf, alive)
    for i in range(collisions):
        state.depth[points.slot[i]] += 1
    return end


# ------------------------------------------------------------------------------ surfaces


@kernel
def hide_lamps(scene, work, count, in_media):
    """Trace the unscattered camera rays again, without area lights.

    With `in_media` that includes the rays that are inside a medium.
    """
    rays, hits, depth, medium = work.rays, work.hits, work.media.depth, work.media.medium
    first = np.int64(0)
    while first < count:
        end = first
        while (
            end < count
            and depth[rays.slot[end]] == 0
            and (in_media or medium[rays.slot[end]] < 0)
        ):
            end += 1
        if end > first:
            for k in range(first, end):  # `reset_hits` would reset others in the same row
                hits.t[k] = np.float32(np.inf)
                hits.prim[k] = -1
            groups = scene.camera_groups
            intersect(groups, rays, hits, first, end - first, False, None)
        first = end + 1


@kernel
def leave_surfaces(scene, work, count, last):
    """Continue the scattered rays, updating their medium; return how many continue.

    `last` is the depth of the last segment.

    Passing straight through is no scattering event: the path keeps the pdf, the previous
    position and the depth of its last event.
    """
    media, state, rays, points = scene.media, work.media, work.rays, work.points
    kept = np.int64(0)
    for k in range(count):
        slot, i = rays.slot[k], rays.point[k]
        straight = rays.lobe[k] == STRAIGHT
        if not straight:
            if state.depth[slot] >= last:
                continue
            state.depth[slot] += 1
        state.medium[slot] = medium_behind(
            media,
            points.shape[i],
            column(points.normal, i),
            column(rays.direction, k),
            state.medium[slot],
        )
        rays.pdf[kept] = points.pdf[i] if straight else rays.pdf[k]
        rays.eta[kept], rays.slot[kept] = rays.eta[k], slot
        for c in range(3):
            rays.previous[c, kept] = (
                points.previous[c, i] if straight else points.position[c, i]
            )
            rays.origin[c, kept] = rays.origin[c, k]
            rays.direction[c, kept] = rays.direction[c, k]
            rays.throughput[c, kept] = rays.throughput[c, k]
        kept += 1
    return kept
