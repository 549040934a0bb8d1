"""Stage 5, emission: what a path finds where it arrives, on surfaces or beyond them."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import CONSTANT
from renderer.lanes.functions import (
    fabs,
    first_lanes,
    lane,
    lowest_bit,
    mask_bits,
    select,
    splat_f32,
)
from renderer.lanes.memory import gather_row, load_row
from renderer.lights.area import pdf_area_light
from renderer.lights.choose import light_probability
from renderer.lights.constant import SPHERE_PDF
from renderer.sampling import power_heuristic
from renderer.vectors import column, dot, gather3, length, load3


@kernel
def add_lanes(radiance, slot, value, mask):
    """Add the masked lanes of a colour to their pixels, lane after lane."""
    bits = mask_bits(mask)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        s = lane(slot, j)
        radiance[0, s] += lane(value.x, j)
        radiance[1, s] += lane(value.y, j)
        radiance[2, s] += lane(value.z, j)


@kernel
def _bsdf_sample_weight(weigh, pdf, light_pdf):
    """Return the weight of a BSDF sample beside light sampling; mirrors (pdf 0) get 1."""
    if weigh is None:
        return splat_f32(1.0)
    return select(pdf > 0.0, power_heuristic(pdf, light_pdf), 1.0)


@kernel
def _density_normal(replay, points, i):
    """Return the normal that the density of light samples goes by, see `lights.triangles`.

    Only on smooth meshes is Mitsuba's another one.
    """
    if replay is None:
        return load3(points.normal, i)
    return load3(points.shading_normal, i)


@kernel
def _seen_from(exact, replay, points, i, wo):
    """Return the previous point of the path, the distance to it, and the |cosine| here.

    Up to the offset of the ray's origin, but exactly where the exact points are kept.
    """
    here, normal = load3(points.position, i), _density_normal(replay, points, i)
    if exact is None:
        t = load_row(points.t, 0, i)
        return here + wo * t, t, fabs(dot(wo, normal))
    previous = load3(exact, i)
    back = previous - here
    distance = length(back)
    return previous, distance, fabs(dot(back, normal)) / distance


@kernel
def add_emission(scene, lights, areas, points, count, radiance):
    """Add L_e of the area lights that `count` paths have arrived at."""
    if areas is None:
        return
    settings = scene.settings
    probability = light_probability(lights, settings.every_light)
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        shape = load_row(points.shape, 0, i)
        light = gather_row(scene.shapes.light, 0, shape, valid)
        wo = load3(points.wo, i)
        shining = valid & (light >= 0) & (dot(wo, load3(points.shading_normal, i)) > 0.0)
        if mask_bits(shining) == 0:
            continue
        previous, distance, cosine = _seen_from(
            points.previous, settings.replay, points, i, wo
        )
        light_pdf = pdf_area_light(
            areas,
            scene.surfaces,
            light,
            load_row(points.prim, 0, i),
            shining,
            previous,
            distance,
            cosine,
        )
        weight = _bsdf_sample_weight(
            settings.weigh, load_row(points.pdf, 0, i), light_pdf * probability
        )
        emitted = gather3(areas.radiance, light, shining) * weight
        carried = load3(points.throughput, i) * emitted
        add_lanes(radiance, load_row(points.slot, 0, i), carried, shining)


@kernel
def add_environment(settings, lights, constants, rays, hits, first, count, radiance):
    """Add the constant environment for the rays that have hit nothing."""
    if constants is None:
        return
    index = 0
    while lights.kind[index] != CONSTANT:
        index += 1
    color = column(constants.radiance, index)
    probability = light_probability(lights, settings.every_light)
    for i in range(first, first + count, 16):
        valid = first_lanes(first + count - i)
        missed = valid & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) == 0:
            continue
        pdf = load_row(rays.pdf, 0, i)
        weight = _bsdf_sample_weight(
            settings.weigh, pdf, splat_f32(SPHERE_PDF * probability)
        )
        carried = load3(rays.throughput, i) * weight * color
        add_lanes(radiance, load_row(rays.slot, 0, i), carried, missed)
