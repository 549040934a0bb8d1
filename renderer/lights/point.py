"""Point light: E = I / r^2 across the direction to it."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import POINT
from renderer.lanes.functions import mask_bits, select, splat_f32
from renderer.lights.light_sample import LightSample
from renderer.vectors import dot, gather3, length, select3


@kernel
def chosen(mask, delta, other):
    """Return the delta light's sample where the mask is set, else the `other` sample."""
    return LightSample(
        select3(mask, delta.wi, other.wi),
        select(mask, delta.distance, other.distance),
        select3(mask, delta.radiance, other.radiance),
        select(mask, delta.pdf, other.pdf),
    )


@kernel
def sample_point_lights(points, light, kind, position, sample):
    """Return `sample` with the lanes whose light is a point replaced."""
    if points is None:
        return sample
    mine = kind == POINT
    if mask_bits(mine) == 0:
        return sample
    to_light = gather3(points.position, light, mine) - position
    r = length(to_light)
    radiance = gather3(points.intensity, light, mine) / dot(to_light, to_light)
    return chosen(mine, LightSample(to_light / r, r, radiance, splat_f32(0.0)), sample)
