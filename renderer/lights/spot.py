"""Spot light: a point light that fades linearly in angle from beam width to cutoff."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import SpotLights
from renderer.lanes.functions import select, splat_f32
from renderer.lanes.mathematics import arccos
from renderer.lanes.memory import gather_row
from renderer.lights.kind import LightSample, sample_light
from renderer.vectors import dot, gather3, length


@sample_light.by(SpotLights)
@kernel
def sample_spot(spots, kind, light, mask, position, x, y, z):
    """Look straight at the light, and see how far off its axis one is."""
    to_light = gather3(spots.position, light, mask) - position
    r = length(to_light)
    wi = to_light / r
    cosine = -dot(wi, gather3(spots.axis, light, mask))
    from_cutoff = gather_row(spots.cutoff, 0, light, mask) - arccos(cosine)
    fading = from_cutoff * gather_row(spots.inverse_transition, 0, light, mask)
    falloff = select(
        cosine >= gather_row(spots.cos_beam, 0, light, mask), splat_f32(1.0), fading
    )
    lit = cosine > gather_row(spots.cos_cutoff, 0, light, mask)
    falloff = select(lit, falloff, splat_f32(0.0))
    radiance = gather3(spots.intensity, light, mask) * (falloff / dot(to_light, to_light))
    return LightSample(wi, r, radiance, splat_f32(0.0))
