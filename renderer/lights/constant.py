"""Constant environment: the same radiance from every direction."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import CONSTANT
from renderer.lanes.functions import mask_bits, splat_f32
from renderer.lights.light_sample import LightSample
from renderer.lights.point import chosen
from renderer.sampling import square_to_sphere
from renderer.vectors import gather3

SPHERE_PDF = np.float32(1.0 / (4.0 * np.pi))
_FOUR_PI = np.float32(4.0 * np.pi)


@kernel
def sample_constant_lights(constants, light, kind, x, y, sample):
    """Return `sample` with the lanes whose light is the environment replaced.

    Uniform over the whole sphere, as Mitsuba does it: half the samples of a surface
    point are below its horizon.
    """
    if constants is None:
        return sample
    mine = kind == CONSTANT
    if mask_bits(mine) == 0:
        return sample
    distance = splat_f32(np.float32(constants.distance))
    radiance = gather3(constants.radiance, light, mine) * _FOUR_PI
    wi = square_to_sphere(x, y)
    return chosen(mine, LightSample(wi, distance, radiance, splat_f32(SPHERE_PDF)), sample)
