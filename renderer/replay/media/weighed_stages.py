"""Stages of Mitsuba's `volpathmis` that replace the integrators' own.

The integrators' stages multiply throughput, light and MIS weight at once. Here a weight
needs the densities of all colours (`replay.media.spectral_mis`), so the stages return light
and its density separately.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.direct_light import reflect_light
from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.scatter import append_rays, scatter_kind
from renderer.integrators.stages.surface import frame_at, local_wo, world_direction
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    mask_bits,
    popcount,
    select,
    splat_f32,
    splat_mask,
)
from renderer.kernels.lanes.memory import append_row, gather_row, load_row, scatter_row
from renderer.kernels.lanes.vectors import append3, dot, gather_rows3, load3
from renderer.kernels.records.batch import Workspace
from renderer.plugins.bsdfs.kind import (
    SMOOTH,
    Numbers,
    eval_pdf_bsdf,
    lobe_of,
    sample_bsdf,
)
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.lights.area import add_emission, emitted_light, shining_lights
from renderer.plugins.lights.environment import (
    add_environment,
    environment_light,
    points_left,
)
from renderer.plugins.lights.kind import add_lanes, light_probability
from renderer.plugins.media.phase_functions import eval_phase
from renderer.plugins.sampling.numbers_and_warps import to_local
from renderer.replay.media.carried import (
    add_found_light,
    cast_collisions,
    grey,
    rcp,
    scatter3,
)
from renderer.replay.media.record import pixels_of
from renderer.replay.media.spectral_mis import (
    LIT,
    PATH,
    OfBothWays,
    balanced,
    inverse_of,
    unless_void,
)


@method_kernel
def scatter_all(bsdf, settings, bounce, points, numbers, start, stop, rays, end):
    """Scatter as `scatter_kind`, but without roulette and also at throughput 0."""
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame, wo = local_wo(bsdf, points, i)
        drawn = Numbers(
            load_row(numbers, 0, i),
            load_row(numbers, 1, i),
            load_row(numbers, 2, i),
            bsdf.arithmetic,
        )
        chosen = sample_bsdf(parameters_at(bsdf.form, points, i), wo, drawn)
        lobe = lobe_of(chosen)
        end = append_rays(
            rays,
            end,
            points,
            i,
            world_direction(bsdf, frame, chosen.wi),
            load3(points.throughput, i) * chosen.weight,
            select(lobe == SMOOTH, chosen.pdf, 0.0),
            load_row(points.eta, 0, i) * chosen.eta,
            lobe,
            mine & (chosen.pdf > 0.0),
        )
    return end


@kernel
def _append_light(points, samples, i, value, pdf, probability, mask, shadow_rays, cast):
    """Append light samples times a value; `t_max` holds `pdf` / light pdf."""
    light_pdf = load_row(samples.pdf, 0, i) * probability
    carried = value * load3(samples.radiance, i) / probability
    lit = mask & (fabs(carried.x) + fabs(carried.y) + fabs(carried.z) > 0.0)
    ratio = select(light_pdf > 0.0, pdf * rcp(light_pdf, light_pdf > 0.0), splat_f32(0.0))
    append3(shadow_rays.radiance, cast, carried, lit)
    append_row(shadow_rays.t_max, 0, cast, ratio, lit)
    append_row(shadow_rays.slot, 0, cast, load_row(points.slot, 0, i), lit)
    return cast + popcount(mask_bits(lit))


@kernel
def _reflect(bsdf, probability, points, samples, start, stop, shadow_rays, cast, one):
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame = frame_at(bsdf, points, i)
        f_cos, pdf = eval_pdf_bsdf(
            parameters_at(bsdf.form, points, i),
            to_local(frame, load3(points.wo, i)),
            to_local(frame, load3(samples.wi, i)),
        )
        f_cos = unless_void(f_cos, splat_mask(one))
        cast = _append_light(
            points, samples, i, f_cos, pdf, probability, mine, shadow_rays, cast
        )
    return cast


@method_kernel
def reflect_alone(
    bsdf, settings, probability, points, samples, start, stop, shadow_rays, cast
):
    """Append the light samples reflected by one kind of BSDF; return the new count."""
    return _reflect(
        bsdf, probability, points, samples, start, stop, shadow_rays, cast, False
    )


@method_kernel
def reflect_all_or_none(
    bsdf, settings, probability, points, samples, start, stop, shadow_rays, cast
):
    """Append them for a single density: black if any colour is not reflected."""
    return _reflect(
        bsdf, probability, points, samples, start, stop, shadow_rays, cast, True
    )


@cast_collisions.by(OfBothWays)
@kernel
def _cast_collisions(carry, scene, work, count):
    points, samples, cast = work.media.collisions, work.light_samples, np.int64(0)
    probability = light_probability(scene.lights, scene.settings)
    for i in range(0, count, 16):
        mine, medium = first_lanes(count - i), load_row(points.bsdf, 0, i)
        cosine = -dot(load3(points.wo, i), load3(samples.wi, i))
        at = load3(points.position, i)
        phase = eval_phase(scene.media, medium, at, cosine, mine)
        value, shadow_rays = grey(phase), work.shadow_rays
        cast = _append_light(
            points, samples, i, value, phase, probability, mine, shadow_rays, cast
        )
    return cast


# ------------------------------------------------------------------------------- emission


@kernel
def _note(found, slot, color, pdf, mask):
    """Store the radiance and the density of lights by slot; both may be scalars."""
    one = splat_f32(1.0)
    scatter3(found, 0, slot, grey(one) * color, mask)
    scatter_row(found, 3, slot, one * pdf, mask)


@method_kernel
def note_emission(kind, settings, lights, shapes, points, count, found):
    """Store emitted radiance and its density, instead of adding it as `add_emission`."""
    probability = light_probability(lights, settings)
    for i in range(0, count, 16):
        light, shining = shining_lights(kind, shapes, points, i, count)
        if mask_bits(shining) == 0:
            continue
        color, pdf = emitted_light(kind.lights, kind, points, i, light, shining)
        _note(found, load_row(points.slot, 0, i), color, pdf * probability, shining)


@method_kernel
def note_environment(kind, settings, lights, points, rays, hits, first, count, found):
    """Store environment radiance and its density, instead of adding it."""
    probability = light_probability(lights, settings) * np.float32(kind.sampled)
    for i in range(first, first + count, 16):
        valid = first_lanes(first + count - i)
        missed = valid & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) == 0:
            continue
        position, direction = points_left(points, rays, i, missed), load3(rays.direction, i)
        color, pdf = environment_light(kind.lights, position, direction, missed)
        _note(found, load_row(rays.slot, 0, i), color, pdf * probability, missed)


@kernel
def _into_numbers(work):
    """Return the workspace with its random numbers in place of `radiance`."""
    return Workspace(
        work.rays,
        work.hits,
        work.shadow_rays,
        work.points,
        work.light_samples,
        work.film,
        work.numbers,
        work.order,
        work.ends,
        work.numbers,
        work.splats,
        work.waiting,
        work.tally,
        work.media,
        work.panes,
    )


@add_found_light.by(OfBothWays)
@kernel
def _add_found_light(carry, scene, tile, work, count):
    rays, hits, found, numbers = work.rays, work.hits, work.numbers, carry.numbers
    nothing = splat_f32(0.0)
    for i in range(0, count, 16):
        slot = load_row(rays.slot, 0, i)
        _note(found, slot, grey(nothing), nothing, first_lanes(count - i))
    add_emitted_light(scene, _into_numbers(work), np.int64(0), count, True)
    for i in range(0, count, 16):
        on, slot = first_lanes(count - i), load_row(rays.slot, 0, i)
        pixel, sampled = pixels_of(tile, slot), load_row(rays.pdf, 0, i) > 0.0
        color, pdf = gather_rows3(found, 0, slot, on), gather_row(found, 3, slot, on)
        lit = gather_rows3(numbers, PATH + LIT, pixel, on)
        ratio = select(sampled, pdf, nothing)
        one = splat_mask(carry.one != 0)
        weight = balanced(load3(rays.throughput, i), lit, ratio, one)
        add_lanes(work.radiance, slot, color * weight, on)

        # of a lamp that light passes straight through Mitsuba keeps the density, for what
        # is behind it
        prim = load_row(hits.prim, 0, i)
        hit = on & (prim >= 0)
        shape = gather_row(scene.primitives.shape, 0, prim, hit)
        lamp = hit & sampled & (gather_row(scene.shapes.light, 0, shape, hit) >= 0)
        scatter3(numbers, PATH + LIT, pixel, lit * inverse_of(pdf), lamp)


INSTEAD = {
    scatter_kind: scatter_all,
    reflect_light: reflect_alone,
    add_emission: note_emission,
    add_environment: note_environment,
}
"""Methods of the integrators' stages -> their replacements."""

INSTEAD_OF_ONE = INSTEAD | {reflect_light: reflect_all_or_none}
"""The same for use_spectral_mis = false."""
