"""Diffuse (Lambertian) BSDF: f = k_d / pi."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.plugins.bsdfs.kind import BsdfKind, BsdfSample, Color
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.scene_file.description import Diffuse as Description
from renderer.scene_file.objects.objects import read_texture


class Diffuse(NamedTuple):
    """Its parameters."""

    reflectance: Color  # k_d


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    return Description(read_texture(properties, "reflectance", 0.5))


@kernel
def eval_pdf(diffuse, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    cos_i = select(wi.z > 0.0, wi.z, 0.0)
    return diffuse.reflectance * (INV_PI * cos_i), INV_PI * cos_i


@kernel
def sample(diffuse, wo, numbers):
    """Sample a direction by its cosine: f cos / pdf is exactly k_d."""
    wi = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    cos_i = select(wi.z > 0.0, wi.z, 0.0)
    return BsdfSample(wi, diffuse.reflectance, INV_PI * cos_i, splat_f32(1.0))


@kernel
def albedo(diffuse):
    """Return k_d."""
    return diffuse.reflectance


DIFFUSE = BsdfKind(
    "diffuse",
    Diffuse,
    read,
    "the same in all directions (Lambert)",
    sample,
    eval_pdf,
    albedo=albedo,
)
