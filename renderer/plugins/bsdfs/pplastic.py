"""Plastic of Mitsuba's `pplastic`, without polarization: a rough coat over a diffuse base.

Light passes the coat as if it were smooth, once on its way in and once on its way out.
What the coat throws back into the base is lost, unlike in `roughplastic`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32
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
from renderer.plugins.bsdfs.roughness import read_roughness
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.plugins.textures.registry import mean_of
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_scalar_texture, read_texture


class PPlastic(NamedTuple):
    """Its parameters."""

    alpha_u: Float
    alpha_v: Float
    beckmann: Float  # 1; GGX: 0
    every_normal: Float  # 1: also normals that are not seen are sampled
    eta: Float  # index of refraction, inside over outside
    specular_share: Float  # of samples
    diffuse_reflectance: Color
    specular_reflectance: Color


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    given = [name for name in ("int_ior", "ext_ior") if properties.has(name)]
    if properties.has("eta") and given:
        properties.fail(given[0], 'a value together with "eta"', "one of the two")
    if properties.has("eta"):
        eta = read_scalar_texture(properties, "eta", 1.0)
    else:
        eta = read_relative_index(properties, "polypropylene", rough=True)
    diffuse = read_texture(properties, "diffuse_reflectance", 0.5)
    specular = read_texture(properties, "specular_reflectance", 1.0)
    total = mean_of(diffuse) + mean_of(specular)
    values = {
        "eta": eta,
        "specular_share": mean_of(specular) / total if total else 0.0,
        "diffuse_reflectance": diffuse,
        "specular_reflectance": specular,
    }
    return OtherBsdf("pplastic", read_roughness(properties) | values)


@kernel
def eval_pdf(plastic, wo, wi):
    """Return f cos, and the density [1/sr] with which `sample` chooses wi."""
    facets, h = microfacets(plastic), normalize(wo + wi)
    above = (wo.z > 0.0) & (wi.z > 0.0)
    fresnel, _, _ = fresnel_dielectric(dot(wo, h), plastic.eta)
    shadowing = unshadowed(facets, wo, h) * unshadowed(facets, wi, h)
    coat = fresnel * normal_density(facets, h) * shadowing / (4.0 * wo.z)
    back, _, _ = fresnel_dielectric(wo.z, plastic.eta)
    enters, _, _ = fresnel_dielectric(wi.z, plastic.eta)
    cosine = INV_PI * wi.z
    base = plastic.diffuse_reflectance * ((1.0 - back) * (1.0 - enters) * cosine)
    color = plastic.specular_reflectance * coat + base

    mirrored = normal_pdf(facets, wo, h) / (4.0 * dot(wi, h))
    share = plastic.specular_share
    pdf = share * mirrored + (1.0 - share) * cosine
    none = splat_f32(0.0)
    return select3(above, color, vec3(none, none, none)), select(above, pdf, 0.0)


@kernel
def sample(plastic, wo, numbers):
    """Mirror at a facet of the coat, or scatter from the base."""
    m = sample_normal(microfacets(plastic), wo, numbers)
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    wi = select3(numbers.choice < plastic.specular_share, reflect(wo, m), scattered)
    f_cos, pdf = eval_pdf(plastic, wo, wi)
    return BsdfSample(wi, f_cos * select(pdf > 0.0, 1.0 / pdf, 0.0), pdf, splat_f32(1.0))


@kernel
def albedo(plastic, wo):
    """Return pi f of light along the normal, as Mitsuba's default for BSDFs."""
    none = splat_f32(0.0)
    f_cos, _ = eval_pdf(plastic, wo, vec3(none, none, none + 1.0))
    return (1.0 / INV_PI) * f_cos


PPLASTIC = BsdfKind(
    "pplastic",
    PPlastic,
    read,
    "a diffuse base under a rough coat, polarization left out",
    sample,
    eval_pdf,
    albedo=albedo,
    oriented=True,
)
