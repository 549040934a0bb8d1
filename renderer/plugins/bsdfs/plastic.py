"""Smooth plastic: a diffuse base under a clear coat, which mirrors by Fresnel's equations.

Light enters through the coat, is scattered by the base, is partly thrown back from within
the coat, and leaves through it: a geometric series, whose factor is the mean reflectance of
the coat from inside.
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
    thrown_back: Float  # mean reflectance of the coat from inside
    nonlinear: Float  # 1: what is thrown back takes on colour again and again
    specular_share: Float  # of samples, before Fresnel's factor
    diffuse_reflectance: Color
    specular_reflectance: Color


def read_coated(properties: Any, eta: float) -> dict[str, Any]:
    """Return the parameters that smooth and rough plastic share.

    The mean internal reflectance of the coat (`thrown_back`) is computed by each.
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
    """Return the share of diffuse light that a smooth interface reflects.

    Below 1 by the fit of [Egan1973], otherwise by that of [DEon2011]: polynomials in the
    index, or in one over it.
    """
    inverse = 1.0 / eta
    if eta < 1.0:
        return -1.4399 * eta**2 + 0.7099 * eta + 0.6681 + 0.0636 * inverse
    fit = (0.919317, -3.4793, 6.75335, -7.80989, 4.98554, -1.36881)
    return sum(factor * inverse**k for k, factor in enumerate(fit))


@kernel
def coated_base(plastic):
    """Return pi f of the base under the coat, but for what enters and leaves."""
    d, again = plastic.diffuse_reflectance, plastic.thrown_back
    white, one = splat_f32(1.0) - again, splat_f32(1.0)
    colored = vec3(one, one, one) - d * again
    series = select3(plastic.nonlinear != 0.0, colored, vec3(white, white, white))
    return d / series * (1.0 / (plastic.eta * plastic.eta))


@kernel
def specular_probability(plastic, reflected):
    """Return how often the coat is sampled, which reflects so much of what arrives."""
    specular = reflected * plastic.specular_share
    diffuse = (1.0 - reflected) * (1.0 - plastic.specular_share)
    return specular / (specular + diffuse)


@kernel
def eval_pdf(plastic, wo, wi):
    """Return f cos of the base, and the density [1/sr] with which `sample` chooses wi."""
    above = (wo.z > 0.0) & (wi.z > 0.0)
    back, _, _ = fresnel_dielectric(wo.z, plastic.eta)
    enters, _, _ = fresnel_dielectric(wi.z, plastic.eta)
    cosine = select(above, INV_PI * wi.z, 0.0)
    f_cos = coated_base(plastic) * (cosine * (1.0 - back) * (1.0 - enters))
    return f_cos, cosine * (1.0 - specular_probability(plastic, back))


@kernel
def sample(plastic, wo, numbers):
    """Mirror at the coat, or scatter from the base."""
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
    """Return the colour of the base without its coat, as Mitsuba does."""
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
