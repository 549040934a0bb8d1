"""Rough dielectric: microfacets that reflect and refract [Walter2007]."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select, splat_f32, sqrt
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.dielectric import read_relative_index
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Color,
    Float,
    albedo_at_normal_incidence,
)
from renderer.plugins.bsdfs.microfacets import (
    Microfacets,
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


class RoughDielectric(NamedTuple):
    """Its parameters."""

    alpha_u: Float
    alpha_v: Float
    beckmann: Float  # 1: Beckmann, 0: GGX
    every_normal: Float  # 1: all normals are sampled, not only visible ones
    eta: Float  # index of refraction, inside over outside
    specular_reflectance: Color
    specular_transmittance: Color


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    values = {
        "eta": read_relative_index(properties, "bk7", rough=True),
        "specular_reflectance": read_texture(properties, "specular_reflectance", 1.0),
        "specular_transmittance": read_texture(properties, "specular_transmittance", 1.0),
    }
    return OtherBsdf("roughdielectric", read_roughness(properties) | values)


@kernel
def _sampled(facets, cos_o):
    """Return the distribution that normals are sampled from.

    If all normals are sampled, it is a wider one, so that weights stay small [Walter2007,
    section 5.3].
    """
    wider = select(facets.every_normal, 1.2 - 0.2 * sqrt(fabs(cos_o)), 1.0)
    return Microfacets(
        facets.alpha_u * wider, facets.alpha_v * wider, facets.beckmann, facets.every_normal
    )


@kernel
def _upward(v, of):
    """Return v, or -v where `of` is below the surface."""
    return select3(of < 0.0, -v, v)


@kernel
def eval_pdf(glass, wo, wi):
    """Return f |cos| and the pdf [1/sr]."""
    facets = microfacets(glass)
    reflected = wo.z * wi.z > 0.0
    crossing = select(wo.z > 0.0, glass.eta, 1.0 / glass.eta)
    m = normalize(wo + wi * select(reflected, 1.0, crossing))
    m = _upward(m, m.z)
    cos_o, cos_i = dot(wo, m), dot(wi, m)
    fresnel, _, _ = fresnel_dielectric(cos_o, glass.eta)
    # Jacobian of the half vector by wi, for refraction
    bend = cos_o + crossing * cos_i
    refracted = 1.0 / (bend * bend)

    shown = unshadowed(facets, wo, m) * unshadowed(facets, wi, m)
    density = normal_density(facets, m) * shown
    mirrored = fresnel * density / (4.0 * fabs(wo.z))
    # eta^2 of the half vector and 1 / eta^2 of the radiance cancel
    bent = (1.0 - fresnel) * density * fabs(cos_o * cos_i / wo.z) * refracted
    color = select3(
        reflected,
        glass.specular_reflectance * mirrored,
        glass.specular_transmittance * bent,
    )

    pdf = normal_pdf(_sampled(facets, wo.z), _upward(wo, wo.z), m)
    turned = select(reflected, 0.25 / cos_i, crossing * crossing * cos_i * refracted)
    pdf = pdf * fabs(turned) * select(reflected, fresnel, 1.0 - fresnel)
    facing = (cos_o * wo.z > 0.0) & (cos_i * wi.z > 0.0)
    none = splat_f32(0.0)
    return (
        select3(wo.z != 0.0, color, vec3(none, none, none)),
        select(facing, pdf, 0.0),
    )


@kernel
def sample(glass, wo, numbers):
    """Sample a facet, then reflection or refraction; most factors of f |cos| / pdf cancel.

    With `every_normal` the weight belongs to the plain distribution, but the pdf to the
    wider one. So the weight differs from f |cos| / pdf by a few per cent, as in Mitsuba.
    """
    facets = microfacets(glass)
    wider = _sampled(facets, wo.z)
    upward = _upward(wo, wo.z)
    m = sample_normal(wider, upward, numbers)
    pdf = normal_pdf(wider, upward, m)
    cos_o = dot(wo, m)
    fresnel, cos_t, crossing = fresnel_dielectric(cos_o, glass.eta)
    reflected = numbers.choice <= fresnel
    bent = m * (cos_o / crossing + cos_t) - wo * (1.0 / crossing)
    wi = select3(reflected, reflect(wo, m), bent)

    cos_i = dot(wi, m)
    bend = cos_o + crossing * cos_i
    turned = select(reflected, 0.25 / cos_i, crossing * crossing * cos_i / (bend * bend))
    seen = unshadowed(facets, wi, m)
    all_of_them = seen * unshadowed(facets, wo, m) * cos_o / (wo.z * m.z)
    weight = select(facets.every_normal, all_of_them, seen)
    weight = select((pdf > 0.0) & (wo.z != 0.0), weight, 0.0)
    squeeze = 1.0 / (crossing * crossing)
    color = select3(
        reflected, glass.specular_reflectance, glass.specular_transmittance * squeeze
    )
    return BsdfSample(
        wi,
        color * weight,
        pdf * fabs(turned) * select(reflected, fresnel, 1.0 - fresnel),
        select(reflected, 1.0, crossing),
    )


ROUGHDIELECTRIC = BsdfKind(
    "roughdielectric",
    RoughDielectric,
    read,
    "rough glass",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
    transmits=True,
    oriented=True,
)
