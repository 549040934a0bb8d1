"""Rough plastic: a diffuse base under a rough dielectric coat.

The transmittance of the coat is the mean over its facets, from a table
(`rough_transmittance`), instead of the Fresnel transmittance of one angle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    to_i32,
)
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.dielectric import read_relative_index
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfKind, BsdfSample, Color, Float
from renderer.plugins.bsdfs.microfacets import (
    microfacets,
    normal_density,
    normal_pdf,
    sample_normal,
    unshadowed,
)
from renderer.plugins.bsdfs.mirror import reflect
from renderer.plugins.bsdfs.parameters import Table, entry_of
from renderer.plugins.bsdfs.plastic import coated_base, read_coated, specular_probability
from renderer.plugins.bsdfs.rough_transmittance import RESOLUTION, rough_transmittance
from renderer.plugins.bsdfs.roughness import read_roughness
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.scene_file.description import OtherBsdf


class RoughPlastic(NamedTuple):
    """Its parameters."""

    alpha_u: Float
    alpha_v: Float  # equal to alpha_u: the table is for an isotropic roughness
    beckmann: Float  # 1: Beckmann, 0: GGX
    every_normal: Float  # 1: all normals are sampled, not only visible ones
    eta: Float  # index of refraction, inside over outside
    thrown_back: Float  # mean internal reflectance of the coat
    nonlinear: Float  # 1: each internal reflection is coloured by the base again
    specular_share: Float  # probability of specular samples, before the table's factor
    diffuse_reflectance: Color
    specular_reflectance: Color
    transmittance: Table  # of the coat, at cosines 0, 1 / 63, ... 1


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    rough = read_roughness(properties, textured=False)
    if rough["alpha_u"] != rough["alpha_v"]:
        both = f"{rough['alpha_u']:g} together with alpha_v {rough['alpha_v']:g}"
        properties.fail("alpha_u", both, "the same roughness along both")
    eta = read_relative_index(properties, "polypropylene", rough=True)
    transmittance, thrown_back = rough_transmittance(
        bool(rough["beckmann"]), rough["alpha_u"], eta
    )
    tables = {"transmittance": transmittance, "thrown_back": thrown_back}
    return OtherBsdf("roughplastic", rough | tables | read_coated(properties, eta))


@kernel
def transmitted(plastic, cosine):
    """Return the transmittance of the coat at a cosine, interpolated linearly."""
    x = maximum(cosine, 0.0) * (RESOLUTION - 1)
    below = minimum(floor(x), RESOLUTION - 2)
    i = to_i32(below)
    lower = entry_of(plastic.transmittance, i)
    return lower + (entry_of(plastic.transmittance, i + 1) - lower) * (x - below)


@kernel
def eval_coated(plastic, base, passes, probability, wo, wi):
    """Return f cos, and the pdf [1/sr] of `sample_coated`.

    Parameters
    ----------
    base
        pi f of the base, RGB, without its coat.
    passes
        Transmittance of the coat along wo, times that along wi.
    probability
        Probability that `sample_coated` samples the coat.
    """
    facets, h = microfacets(plastic), normalize(wo + wi)
    above = (wo.z > 0.0) & (wi.z > 0.0)
    cosine = INV_PI * wi.z
    fresnel, _, _ = fresnel_dielectric(dot(wo, h), plastic.eta)
    shadowing = unshadowed(facets, wo, h) * unshadowed(facets, wi, h)
    coat = fresnel * normal_density(facets, h) * shadowing / (4.0 * wo.z)
    color = plastic.specular_reflectance * coat + base * (passes * cosine)
    pdf = normal_pdf(facets, wo, h) / (4.0 * dot(wi, h))
    pdf = probability * pdf + (1.0 - probability) * cosine
    none = splat_f32(0.0)
    return select3(above, color, vec3(none, none, none)), select(above, pdf, 0.0)


@kernel
def sample_coated(plastic, probability, wo, numbers):
    """Return a direction, mirrored at a facet of the coat or scattered from the base."""
    m = sample_normal(microfacets(plastic), wo, numbers)
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    return select3(numbers.choice < probability, reflect(wo, m), scattered)


@kernel
def coated_sample(wi, f_cos, pdf):
    """Return the sample of a direction of both lobes together."""
    return BsdfSample(wi, f_cos * select(pdf > 0.0, 1.0 / pdf, 0.0), pdf, splat_f32(1.0))


@kernel
def eval_pdf(plastic, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    leaves, enters = transmitted(plastic, wo.z), transmitted(plastic, wi.z)
    probability = specular_probability(plastic, 1.0 - leaves)
    base = coated_base(plastic)
    return eval_coated(plastic, base, leaves * enters, probability, wo, wi)


@kernel
def sample(plastic, wo, numbers):
    """Sample reflection at a facet of the coat, or the diffuse base."""
    probability = specular_probability(plastic, 1.0 - transmitted(plastic, wo.z))
    wi = sample_coated(plastic, probability, wo, numbers)
    f_cos, pdf = eval_pdf(plastic, wo, wi)
    return coated_sample(wi, f_cos, pdf)


@kernel
def albedo(plastic):
    """Return the albedo of the base without the coat, as in Mitsuba."""
    return plastic.diffuse_reflectance


ROUGHPLASTIC = BsdfKind(
    "roughplastic",
    RoughPlastic,
    read,
    "a diffuse base under a rough coat",
    sample,
    eval_pdf,
    albedo=albedo,
)
