"""Stage 4, direct light: L_o = sum over lights of f I / r^2 V cos, as shadow rays.

The sum itself is made when visibility V is known (`intersect.trace_shadow_rays`).
"""

from __future__ import annotations

import numpy as np

from renderer.bsdfs.diffuse import diffuse_albedo, eval_diffuse, pdf_diffuse
from renderer.jit import kernel
from renderer.kernel_scene import DIFFUSE
from renderer.lanes.functions import first_lanes, mask_bits, popcount, select, splat_f32
from renderer.lanes.memory import append_row, load_row
from renderer.lights.choose import (
    choose_light,
    light_probability,
    sample_light,
)
from renderer.sampling import BLOCKS_PER_BOUNCE, draw4, power_heuristic
from renderer.stages.shading_frame import facing, leave_surface
from renderer.stages.tile import pixel_key
from renderer.vectors import append3, dot, length, load3, select3

# Shadow rays end this fraction before the light, which must not shade itself: at the
# silhouette of a sphere the distance is uncertain by the root of the rounding error (2.4e-4
# of it). It is Mitsuba's own, so that a replay takes the same decisions.
BEFORE_LIGHT = np.float32(1.0 - 15000.0 * 2.0**-24)


@kernel
def _light_sample_weight(weigh, light_pdf, cos_i):
    """Return the weight of a light sample beside BSDF sampling; point lights get 1."""
    if weigh is None:
        return splat_f32(1.0)
    weight = power_heuristic(light_pdf, pdf_diffuse(cos_i))
    return select(light_pdf > 0.0, weight, 1.0)


@kernel
def direct_light(scene, lights, turn, tile, sample, bounce, points, stop, shadow_rays):
    """Ask one light at each of the first `stop` points; return the count of shadow rays.

    The same light for all, number `turn`, or one of all for each, as the settings say.
    """
    settings = scene.settings
    probability = light_probability(lights, settings.every_light)
    cast = np.int64(0)
    block = 2 + bounce * BLOCKS_PER_BOUNCE + turn
    for i in range(0, stop, 16):
        face = facing(
            scene.shapes, scene.bsdfs.kind, points, i, first_lanes(stop - i), DIFFUSE
        )
        if mask_bits(face.mine) == 0:
            continue
        slot = load_row(points.slot, 0, i)
        x, y, z, number = draw4(scene.sampler, pixel_key(tile, slot), sample, block)
        light, x = choose_light(
            lights, settings.every_light, settings.replay, turn, x, number
        )
        position = load3(points.position, i)
        asked = sample_light(lights, scene.surfaces, light, position, x, y, z)

        normal = load3(points.shading_normal, i)
        normal = select3(face.front, normal, -normal)
        cos_i = dot(asked.wi, normal)
        u = load_row(points.uv, 0, i)
        v = load_row(points.uv, 1, i)
        albedo = diffuse_albedo(scene.bsdfs.diffuse, face.bsdf, u, v, face.mine)
        weight = (
            _light_sample_weight(settings.weigh, asked.pdf * probability, cos_i)
            / probability
        )
        throughput = load3(points.throughput, i)
        carried = throughput * eval_diffuse(albedo, cos_i) * asked.radiance * weight

        brightest = carried.x + carried.y + carried.z
        lit = face.mine & (cos_i > 0.0) & (brightest > 0.0)
        origin = leave_surface(points, i, asked.wi)
        to_light = position + asked.wi * asked.distance - origin
        distance = length(to_light)
        append3(shadow_rays.origin, cast, origin, lit)
        append3(shadow_rays.direction, cast, to_light / distance, lit)
        append_row(shadow_rays.t_max, 0, cast, distance * BEFORE_LIGHT, lit)
        append3(shadow_rays.radiance, cast, carried, lit)
        append_row(shadow_rays.slot, 0, cast, slot, lit)
        cast += popcount(mask_bits(lit))
    return cast
