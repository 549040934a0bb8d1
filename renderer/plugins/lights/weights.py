"""Multiple importance sampling: the weights of light samples and BSDF samples."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import lane, lowest_bit, mask_bits, select, splat_f32
from renderer.plugins.sampling.numbers_and_warps import power_heuristic


@kernel
def light_probability(lights, settings):
    """Return the probability of each light to be sampled, if it is the same for all.

    1 if it differs from light to light: the densities of light samples and of rays that hit
    a light then contain it already (`choice.choose`).
    """
    if settings.every_light != 0 or lights.choice.shape[0] != 0:
        return np.float32(1.0)
    return np.float32(1.0 / max(1, lights.asked.size))


@kernel
def light_sample_weight(settings, light_pdf, bsdf_pdf):
    """Return the MIS weight of a light sample; 1 for point lights, which have density 0."""
    if settings.weigh == 0:
        return splat_f32(1.0)
    weight = power_heuristic(light_pdf * np.float32(settings.light_share), bsdf_pdf)
    return select(light_pdf > 0.0, weight, 1.0)


@kernel
def bsdf_sample_weight(settings, pdf, light_pdf):
    """Return the MIS weight of a BSDF sample; 1 for mirrors, which have density 0."""
    if settings.weigh == 0:
        return splat_f32(1.0)
    weight = power_heuristic(pdf, light_pdf * np.float32(settings.light_share))
    return select(pdf > 0.0, weight, 1.0)


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
