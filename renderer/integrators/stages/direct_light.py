"""Stage 5, direct light: L_o = sum over lights of f I / r^2 V cos, by shadow rays.

Three independent steps: a light is sampled from each point, the point's BSDF is evaluated
in that direction, and a shadow ray finds the visibility V.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.intersect import trace_shadow_rays
from renderer.integrators.stages.surface import frame_at, leave_surface
from renderer.kernels.jit import call, count_of, kernel, method_kernel
from renderer.kernels.lanes.functions import fabs, first_lanes, mask_bits, popcount
from renderer.kernels.lanes.memory import append_row, gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import append3, length, load3
from renderer.kernels.records.kernel_scene import (
    CHOOSE_BY_IMPORTANCE,
    CHOOSE_LIGHT,
    DRAW,
    RECORD,
    REFLECT_LIGHT,
    SAMPLE_LIGHT,
)
from renderer.plugins.bsdfs.kind import eval_pdf_bsdf
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.lights.choice import divide_by_probability
from renderer.plugins.lights.kind import light_probability, light_sample_weight
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE, to_local


@kernel
def lights_at_a_point(lights, settings):
    """Return how many lights are sampled at each surface point."""
    sampled = np.int64(lights.sampled.size)
    return min(np.int64(1), sampled) if settings.every_light == 0 else sampled


@kernel
def _number_in_file(lights, samples, count):
    """Replace indices into the sampled lights by indices into all lights."""
    for i in range(0, count, 16):
        chosen = load_row(samples.light, 0, i)
        valid = first_lanes(count - i)
        store_row(samples.light, 0, i, gather_row(lights.sampled, 0, chosen, valid))


@kernel
def samples_lights(scene):
    """Return whether there is a method that chooses a light."""
    by_importance = scene.lights.choice.shape[0] != 0
    return by_importance or scene.sampler[0, CHOOSE_LIGHT] != 0


@kernel
def sample_lights(scene, turn, tile, sample, bounce, work, count):
    """Sample one light from each of the first `count` points.

    According to the settings, that is light number `turn` for all points, or one light
    chosen at each point.
    """
    lights, points, samples = scene.lights, work.points, work.light_samples
    block = 2 + bounce * BLOCKS_PER_BOUNCE + turn
    by_importance = lights.choice.shape[0] != 0
    if by_importance:
        call(
            scene.sampler[0, DRAW],
            scene.sampler[0, RECORD],
            (tile, sample, block, points.slot, count, work.numbers),
        )
        call(
            lights.choice[0, CHOOSE_BY_IMPORTANCE],
            lights.choice[0, RECORD],
            (points, count, work.numbers, samples.light),
        )
    else:
        call(
            scene.sampler[0, CHOOSE_LIGHT],
            scene.sampler[0, RECORD],
            (
                tile,
                sample,
                block,
                turn if scene.settings.every_light != 0 else np.int64(-1),
                lights.sampled.size,
                points.slot,
                count,
                work.numbers,
                samples.light,
            ),
        )
        if lights.sampled.size != lights.count:
            _number_in_file(lights, samples, count)
    for kind in range(lights.methods.shape[0]):
        if lights.methods[kind, SAMPLE_LIGHT] != 0:
            call(
                lights.methods[kind, SAMPLE_LIGHT],
                lights.methods[kind, RECORD],
                (points, work.numbers, samples, count),
            )
    if by_importance:
        divide_by_probability(samples, work.numbers, count)


@kernel
def shadow_rays_to(points, i, wi, distance):
    """Return origins, directions and lengths of shadow rays from points i to i + 15.

    `wi` and `distance` are measured from the point itself; the returned ray starts off the
    surface.
    """
    origin = leave_surface(points, i, wi)
    to_light = load3(points.position, i) + wi * distance - origin
    left = length(to_light)
    return origin, to_light / left, left


@kernel
def is_lit(light):
    """Return the mask of nonzero light; image values may be negative and sum to 0."""
    return fabs(light.x) + fabs(light.y) + fabs(light.z) > 0.0


@method_kernel
def reflect_light(
    bsdf, settings, probability, points, samples, start, stop, shadow_rays, cast
):
    """Append the shadow rays of one kind of BSDF; return the new count.

    `probability` is the probability with which each light was chosen.
    """
    before_light = np.float32(settings.before_light)
    for i in range(start, stop, 16):
        arriving = load3(samples.radiance, i)
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0) & is_lit(arriving)
        if mask_bits(mine) == 0:
            continue
        # f cos of the BSDF, in the local frame
        frame = frame_at(bsdf, points, i)
        wi = load3(samples.wi, i)
        f_cos, bsdf_pdf = eval_pdf_bsdf(
            parameters_at(bsdf.form, points, i),
            to_local(frame, load3(points.wo, i)),
            to_local(frame, wi),
        )

        # contribution if the light is visible
        light_pdf = load_row(samples.pdf, 0, i) * probability
        weight = light_sample_weight(settings, light_pdf, bsdf_pdf) / probability
        throughput = load3(points.throughput, i)
        carried = throughput * f_cos * arriving * weight
        lit = mine & is_lit(carried)

        r = load_row(samples.distance, 0, i)
        origin, direction, distance = shadow_rays_to(points, i, wi, r)
        append3(shadow_rays.origin, cast, origin, lit)
        append3(shadow_rays.direction, cast, direction, lit)
        append_row(shadow_rays.t_max, 0, cast, distance * before_light, lit)
        append3(shadow_rays.radiance, cast, carried, lit)
        append_row(shadow_rays.slot, 0, cast, load_row(points.slot, 0, i), lit)
        cast += popcount(mask_bits(lit))
    return cast


@kernel
def cast_shadow_rays(scene, work):
    """Append the contributions of the light samples to `work.shadow_rays`."""
    bsdfs, ends = scene.bsdfs, work.ends
    probability = light_probability(scene.lights, scene.settings)
    cast = np.int64(0)
    for kind in range(bsdfs.smooth):
        if bsdfs.methods[kind, REFLECT_LIGHT] != 0:
            cast = count_of(
                bsdfs.methods[kind, REFLECT_LIGHT],
                bsdfs.methods[kind, RECORD],
                (
                    scene.settings,
                    probability,
                    work.points,
                    work.light_samples,
                    ends[kind],
                    ends[kind + 1],
                    work.shadow_rays,
                    cast,
                ),
            )
    return cast


@kernel
def direct_light(scene, tile, sample, bounce, work):
    """Add the direct light at points with a smooth BSDF; these are the first points."""
    count = work.ends[scene.bsdfs.smooth]
    if count == 0:
        return
    for turn in range(lights_at_a_point(scene.lights, scene.settings)):
        sample_lights(scene, turn, tile, sample, bounce, work, count)
        cast = cast_shadow_rays(scene, work)
        coherent = bounce == 0
        trace_shadow_rays(
            scene.shadow_groups, work.shadow_rays, cast, coherent, work.radiance
        )
