"""Directional light: parallel rays, the same irradiance everywhere."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import DirectionalLights
from renderer.lanes.functions import splat_f32
from renderer.lights.kind import LightSample, sample_light
from renderer.vectors import gather3


@sample_light.by(DirectionalLights)
@kernel
def sample_directional(directionals, kind, light, mask, position, x, y, z):
    """Look against the light's direction, to beyond the scene."""
    wi = gather3(directionals.to_light, light, mask)
    irradiance = gather3(directionals.irradiance, light, mask)
    distance = splat_f32(np.float32(directionals.distance))
    return LightSample(wi, distance, irradiance, splat_f32(0.0))
