"""Spot light: a point light that fades linearly in angle from beam width to cutoff."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import SPOT
from renderer.lanes.functions import mask_bits, select, splat_f32
from renderer.lanes.mathematics import arccos
from renderer.lanes.memory import gather_row
from renderer.lights.light_sample import LightSample
from renderer.lights.point import chosen
from renderer.vectors import dot, gather3, length


@kernel
def sample_spot_lights(spots, light, kind, position, sample):
    """Return `sample` with the lanes whose light is a spot replaced."""
    if spots is None:
        return sample
    mine = kind == SPOT
    if mask_bits(mine) == 0:
        return sample
    to_light = gather3(spots.position, light, mine) - position
    r = length(to_light)
    wi = to_light / r
    cosine = -dot(wi, gather3(spots.axis, light, mine))
    from_cutoff = gather_row(spots.cutoff, 0, light, mine) - arccos(cosine)
    fading = from_cutoff * gather_row(spots.inverse_transition, 0, light, mine)
    falloff = select(
        cosine >= gather_row(spots.cos_beam, 0, light, mine), splat_f32(1.0), fading
    )
    lit = cosine > gather_row(spots.cos_cutoff, 0, light, mine)
    falloff = select(lit, falloff, splat_f32(0.0))
    radiance = gather3(spots.intensity, light, mine) * (falloff / dot(to_light, to_light))
    return chosen(mine, LightSample(wi, r, radiance, splat_f32(0.0)), sample)
