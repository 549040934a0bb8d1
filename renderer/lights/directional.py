"""Directional light: parallel rays, the same irradiance everywhere."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import DIRECTIONAL
from renderer.lanes.functions import mask_bits, splat_f32
from renderer.lights.light_sample import LightSample
from renderer.lights.point import chosen
from renderer.vectors import gather3


@kernel
def sample_directional_lights(directionals, light, kind, sample):
    """Return `sample` with the lanes whose light is directional replaced."""
    if directionals is None:
        return sample
    mine = kind == DIRECTIONAL
    if mask_bits(mine) == 0:
        return sample
    wi = gather3(directionals.to_light, light, mine)
    irradiance = gather3(directionals.irradiance, light, mine)
    distance = splat_f32(np.float32(directionals.distance))
    return chosen(mine, LightSample(wi, distance, irradiance, splat_f32(0.0)), sample)
