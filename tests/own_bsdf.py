"""A BSDF of one's own: dust as on the Moon (Lommel and Seeliger); docs/adding-a-bsdf.md.

f = albedo / (4 pi (cos_i + cos_o)): light that was scattered once by the grains of a layer.
"""

from typing import NamedTuple

import numpy as np

import renderer
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.plugins.bsdfs.kind import BsdfSample, Color, cosine_direction

INV_PI = np.float32(1.0 / np.pi)


class Lunar(NamedTuple):
    """Its parameters; a default is what a file that is silent about one means."""

    albedo: Color = 0.3  # of a single grain


@renderer.kernel
def eval_pdf(lunar, wo, wi):
    """Return f cos_i, and the density of `sample`; local frame, z is the normal."""
    cos_i = select(wi.z > 0.0, wi.z, 0.0)
    f_cos = lunar.albedo * (0.25 * INV_PI * cos_i / (cos_i + wo.z))
    return f_cos, INV_PI * cos_i


@renderer.kernel
def sample(lunar, wo, numbers):
    """Choose a direction by its cosine; the weight is f cos_i over the density."""
    wi = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    weight = lunar.albedo * (0.25 / (wi.z + wo.z))
    return BsdfSample(wi, weight, INV_PI * wi.z, splat_f32(1.0))


@renderer.kernel
def albedo(lunar):
    """Return what the AOV `albedo` shows."""
    return lunar.albedo


renderer.register_bsdf(
    "lunar", Lunar, sample=sample, eval_pdf=eval_pdf, albedo=albedo, about="Moon dust"
)


def register_mitsuba():
    """Register the same formula with Mitsuba: called in Mitsuba's process, which has it."""
    import mitsuba
    from own_bsdf_in_mitsuba import LunarInMitsuba

    mitsuba.register_bsdf("lunar", LunarInMitsuba)
