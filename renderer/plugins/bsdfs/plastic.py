"""Smooth plastic: a diffuse base under a dielectric coat with specular reflection.

Light enters through the coat and is scattered by the base. A part is reflected internally
by the coat, again and again: a geometric series, with the mean internal reflectance of the
coat as its factor.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import maximum, select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.dielectric import read_relative_index
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import (
    DELTA,
    SMOOTH,
    BsdfKind,
    BsdfSample,
    Color,
    Float,
)
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.plugins.textures.registry import mean_of
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_texture


class Plastic(NamedTuple):
    """Its parameters."""

    eta: Float  # index of refraction, inside over outside
    thrown_back: Float  # mean internal reflectance of the coat
    nonlinear: Float  # 1: each internal reflection is coloured by the base again
    specular_share: Float  # probability of specular samples, before Fresnel's factor
    diffuse_reflectance: Color
    specular_reflectance: Color


def read_coated(properties: Any, eta: float) -> dict[str, Any]:
    """Return the parameters that smooth and rough plastic share.

    The mean internal reflectance (`thrown_back`) is computed by each of them.
    """
    nonlinear = float(properties.boolean("nonlinear", False))
    return {"eta": eta, "nonlinear": nonlinear} | read_reflectances(properties)


def read_reflectances(properties: Any) -> dict[str, Any]:
    """Return the reflectances of base and coat, and the coat's share of both."""
    diffuse = read_texture(properties, "diffuse_reflectance", 0.5)
    specular = read_texture(properties, "specular_reflectance", 1.0)
    total = mean_of(diffuse) + mean_of(specular)
    return {
        "specular_share": mean_of(specular) / total if total else 0.0,
        "diffuse_reflectance": diffuse,
        "specular_reflectance": specular,
    }


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    eta = read_relative_index(properties, "polypropylene")
    thrown_back = diffuse_fresnel(1.0 / eta)
    return OtherBsdf("plastic", {"thrown_back": thrown_back} | read_coated(properties, eta))


def diffuse_fresnel(eta: float) -> float:
    """Return the mean reflectance of a smooth interface for diffuse light.

    For eta below 1 the fit of [Egan1973], otherwise that of [DEon2011]: polynomials in the
    index or in its inverse.
    """
    inverse = 1.0 / eta
    if eta < 1.0:
        return -1.4399 * eta**2 + 0.7099 * eta + 0.6681 + 0.0636 * inverse
    fit = (0.919317, -3.4793, 6.75335, -7.80989, 4.98554, -1.36881)
    return sum(factor * inverse**k for k, factor in enumerate(fit))


@kernel
def coated_base(plastic):
    """Return pi f of the base, without the coat's transmittance for wo and wi."""
    d, again = plastic.diffuse_reflectance, plastic.thrown_back
    white, one = splat_f32(1.0) - again, splat_f32(1.0)
    colored = vec3(one, one, one) - d * again
    series = select3(plastic.nonlinear != 0.0, colored, vec3(white, white, white))
    return d / series * (1.0 / (plastic.eta * plastic.eta))


@kernel
def specular_probability(plastic, reflected):
    """Return the probability of sampling the coat, given its reflectance for wo."""
    specular = reflected * plastic.specular_share
    diffuse = (1.0 - reflected) * (1.0 - plastic.specular_share)
    return specular / (specular + diffuse)


@kernel
def eval_pdf(plastic, wo, wi):
    """Return f cos of the base, and the pdf [1/sr]."""
    above = (wo.z > 0.0) & (wi.z > 0.0)
    back, _, _ = fresnel_dielectric(wo.z, plastic.eta)
    enters, _, _ = fresnel_dielectric(wi.z, plastic.eta)
    cosine = select(above, INV_PI * wi.z, 0.0)
    f_cos = coated_base(plastic) * (cosine * (1.0 - back) * (1.0 - enters))
    return f_cos, cosine * (1.0 - specular_probability(plastic, back))


@kernel
def sample(plastic, wo, numbers):
    """Sample specular reflection at the coat, or the diffuse base."""
    back, _, _ = fresnel_dielectric(wo.z, plastic.eta)
    probability = specular_probability(plastic, back)
    mirrored = numbers.choice < probability
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    enters, _, _ = fresnel_dielectric(scattered.z, plastic.eta)
    rest = 1.0 - probability
    coat = plastic.specular_reflectance * (back / probability)
    base = coated_base(plastic) * ((1.0 - back) * (1.0 - enters) / rest)
    cosine = maximum(scattered.z, 0.0)
    return BsdfSample(
        select3(mirrored, vec3(-wo.x, -wo.y, wo.z), scattered),
        select3(mirrored, coat, base),
        select(mirrored, probability, rest * (INV_PI * cosine)),
        splat_f32(1.0),
        select(mirrored, splat_i32(DELTA), SMOOTH),
    )


@kernel
def albedo(plastic):
    """Return the albedo of the base without the coat, as in Mitsuba."""
    return plastic.diffuse_reflectance


PLASTIC = BsdfKind(
    "plastic",
    Plastic,
    read,
    "a diffuse base under a smooth coat",
    sample,
    eval_pdf,
    albedo=albedo,
    delta=True,
)
