"""Point light: E = I / r^2 across the direction to it."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import PointLights
from renderer.lanes.functions import splat_f32
from renderer.lights.kind import LightSample, sample_light
from renderer.vectors import dot, gather3, length


@sample_light.by(PointLights)
@kernel
def sample_point(points, kind, light, mask, position, x, y, z):
    """Look straight at the light."""
    to_light = gather3(points.position, light, mask) - position
    r = length(to_light)
    radiance = gather3(points.intensity, light, mask) / dot(to_light, to_light)
    return LightSample(to_light / r, r, radiance, splat_f32(0.0))
