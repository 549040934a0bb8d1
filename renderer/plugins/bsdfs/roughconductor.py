"""Rough conductor: microfacets with specular reflection [Torrance1967]."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.conductor import read_complex_index, reflectance
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Color,
    Float,
    albedo_at_normal_incidence,
)
from renderer.plugins.bsdfs.microfacets import (
    microfacets,
    normal_density,
    normal_pdf,
    sample_normal,
    unshadowed,
)
from renderer.plugins.bsdfs.mirror import reflect
from renderer.plugins.bsdfs.roughness import read_roughness
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_texture


class RoughConductor(NamedTuple):
    """Its parameters."""

    alpha_u: Float
    alpha_v: Float
    beckmann: Float  # 1: Beckmann, 0: GGX
    every_normal: Float  # 1: all normals are sampled, not only visible ones
    eta: Color  # real part of the index of refraction, per colour
    k: Color  # its imaginary part: absorption
    specular_reflectance: Color


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    eta, k = read_complex_index(properties)
    values = {
        "eta": eta,
        "k": k,
        "specular_reflectance": read_texture(properties, "specular_reflectance", 1.0),
    }
    return OtherBsdf("roughconductor", read_roughness(properties) | values)


@kernel
def eval_pdf(metal, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    facets, h = microfacets(metal), normalize(wo + wi)
    cosine = dot(wo, h)
    shadowing = unshadowed(facets, wo, h) * unshadowed(facets, wi, h)
    f_cos = normal_density(facets, h) * shadowing / (4.0 * wo.z)
    pdf = normal_pdf(facets, wo, h) / (4.0 * cosine)
    above = (wo.z > 0.0) & (wi.z > 0.0)
    none = splat_f32(0.0)
    color = reflectance(metal, cosine) * f_cos
    return (
        select3(above, color, vec3(none, none, none)),
        select(above & (cosine > 0.0), pdf, 0.0),
    )


@kernel
def sample(metal, wo, numbers):
    """Sample a facet and reflect wo; most factors of f cos / pdf cancel."""
    facets = microfacets(metal)
    m = sample_normal(facets, wo, numbers)
    wi, cosine = reflect(wo, m), dot(wo, m)
    pdf = normal_pdf(facets, wo, m)
    seen = unshadowed(facets, wi, m)
    all_of_them = seen * unshadowed(facets, wo, m) * cosine / (wo.z * m.z)
    weight = select(facets.every_normal, all_of_them, seen)
    weight = select((pdf > 0.0) & (wi.z > 0.0), weight, 0.0)
    color = reflectance(metal, cosine) * weight
    return BsdfSample(wi, color, pdf / (4.0 * dot(wi, m)), splat_f32(1.0))


ROUGHCONDUCTOR = BsdfKind(
    "roughconductor",
    RoughConductor,
    read,
    "rough metal",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
    oriented=True,
)
