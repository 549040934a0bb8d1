"""Principled BSDF [Burley2012; Burley2015].

Without `spec_trans` it does not transmit and is a different kind, black from behind. As in
Mitsuba, a `spec_trans` of 0, given as a float, counts as absent.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select, splat_f32, sqrt
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfKind, BsdfSample, Color, Float
from renderer.plugins.bsdfs.microfacets import (
    normal_density,
    normal_pdf,
    sample_normal,
    unshadowed,
)
from renderer.plugins.bsdfs.mirror import reflect
from renderer.plugins.bsdfs.principled_lobes import (
    coat,
    coat_density,
    coat_normal,
    diffuse_shape,
    ggx_facets,
    no_light,
    schlick_weight,
    sheen_of,
    tinted_reflectance,
)
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_scalar_texture, read_texture

TRANSMITTING = "principled with spec_trans"


class Principled(NamedTuple):
    """Its parameters."""

    base_color: Color
    roughness: Float
    anisotropic: Float
    metallic: Float
    spec_tint: Float
    sheen: Float
    sheen_tint: Float
    flatness: Float
    clearcoat: Float
    clearcoat_gloss: Float
    eta: Float  # index of refraction, inside over outside
    main_specular_sampling_rate: Float
    clearcoat_sampling_rate: Float
    diffuse_reflectance_sampling_rate: Float


class PrincipledGlass(NamedTuple):
    """The parameters of `Principled`, and specular transmission."""

    base_color: Color
    roughness: Float
    anisotropic: Float
    metallic: Float
    spec_tint: Float
    sheen: Float
    sheen_tint: Float
    flatness: Float
    clearcoat: Float
    clearcoat_gloss: Float
    eta: Float
    main_specular_sampling_rate: Float
    clearcoat_sampling_rate: Float
    diffuse_reflectance_sampling_rate: Float
    spec_trans: Float


_SCALARS = Principled._fields[2:10]  # 0 if the file does not give them
_RATES = Principled._fields[-3:]
# relative to the largest sampling rate; below this, light samples have less noise
_NEGLECTED = 0.1


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    values = read_common(properties, _SCALARS, _RATES)
    given = properties.take("spec_trans")
    transmits = given is not None and not (
        isinstance(given.value, float) and given.value == 0.0
    )
    values["eta"] = _read_eta(properties, transmits)
    if transmits:
        values["spec_trans"] = read_scalar_texture(properties, "spec_trans", 0.0)
    return OtherBsdf(TRANSMITTING if transmits else "principled", values)


def read_common(
    properties: Any, scalars: tuple[str, ...], rates: tuple[str, ...]
) -> dict[str, Any]:
    """Return the base colour, the roughness, parameters with default 0, and rates."""
    return {
        "base_color": read_texture(properties, "base_color", 0.5),
        "roughness": read_scalar_texture(properties, "roughness", 0.5),
        **{name: read_scalar_texture(properties, name, 0.0) for name in scalars},
        **{name: properties.number(name, 1.0) for name in rates},
    }


def samples_each_lobe(bsdf: OtherBsdf) -> bool:
    """Return whether no lobe has a sampling rate that is nearly or exactly 0."""
    rates = [float(v) for k, v in bsdf.values.items() if k.endswith("_sampling_rate")]
    return min(rates) >= _NEGLECTED * max(rates) > 0.0


def _read_eta(properties: Any, transmits: bool) -> float:
    """Return the index of refraction; `specular` is an alternative parameter for it."""
    if properties.has("eta"):
        if properties.has("specular"):
            properties.fail("specular", 'a value together with "eta"', "one of the two")
        eta = float(properties.number("eta", 1.5, above=0.0))
        # an interface between equal indices has no effect
        return 1.001 if transmits and eta == 1.0 else eta
    specular = properties.number("specular", 0.5, at_least=0.0)
    if not specular * 0.08 < 1.0:
        properties.fail("specular", f"{specular:g}", "a number below 12.5")
    if transmits and specular == 0.0:
        specular = 0.001
    return 2.0 / (1.0 - math.sqrt(0.08 * specular)) - 1.0


# ------------------------------------------------------------------ without transmission


@kernel
def _shares(material):
    """Return the sampling probabilities of the lobes: specular, coat, diffuse."""
    specular = material.main_specular_sampling_rate
    coated = 0.25 * material.clearcoat * material.clearcoat_sampling_rate
    diffuse = (1.0 - material.metallic) * material.diffuse_reflectance_sampling_rate
    scale = 1.0 / (specular + coated + diffuse)
    return specular * scale, coated * scale, diffuse * scale


@kernel
def _reflected(material, fresnel, cos_o):
    """Return the reflectance of the facets: metallic, tinted and plain dielectric."""
    weight = schlick_weight(cos_o, material.eta)
    crossing = select(cos_o >= 0.0, material.eta, 1.0 / material.eta)
    metal = material.base_color * (1.0 - weight) + weight
    tinted = tinted_reflectance(material.base_color, crossing, weight)
    rest = 1.0 - material.metallic
    plain = rest * (1.0 - material.spec_tint) * fresnel
    return metal * material.metallic + tinted * (rest * material.spec_tint) + plain


@kernel
def _diffuse(material, share, wo, wi, cos_i):
    """Return f cos of the diffuse lobe and sheen; `share`: 1 - metallic."""
    shape = diffuse_shape(material, wo.z, wi.z, cos_i)
    base = material.base_color * (share * INV_PI * shape)
    sheen = sheen_of(material, cos_i) * (1.0 - material.metallic)
    return (base + sheen * select(share > 0.0, splat_f32(1.0), 0.0)) * fabs(wi.z)


@kernel
def eval_pdf(material, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    facets = ggx_facets(material.roughness, material.anisotropic)
    h = normalize(wo + wi)
    cos_o, cos_i = dot(wo, h), dot(wi, h)
    fresnel, _, _ = fresnel_dielectric(cos_o, material.eta)
    shown = unshadowed(facets, wo, h) * unshadowed(facets, wi, h)
    mirrored = normal_density(facets, h) * shown / (4.0 * wo.z)
    # between equal indices nothing is reflected, not even by metal, as in Mitsuba
    mirrored = select(fresnel > 0.0, mirrored, 0.0)
    color = _reflected(material, fresnel, cos_o) * mirrored
    color = color + coat(material, wo, wi, h, schlick_weight(cos_o, material.eta))
    color = color + _diffuse(material, 1.0 - material.metallic, wo, wi, cos_i)

    specular, coated, diffuse = _shares(material)
    coat_pdf = coat_density(material.clearcoat_gloss, h) * h.z
    facet_pdf = specular * normal_pdf(facets, wo, h) + coated * coat_pdf
    pdf = facet_pdf / (4.0 * cos_i) + diffuse * INV_PI * wi.z
    above = (wo.z > 0.0) & (wi.z > 0.0)
    return select3(above, color, no_light()), select(above, pdf, 0.0)


@kernel
def sample(material, wo, numbers):
    """Sample a direction from one of the lobes; the weight is that of all lobes."""
    _, coated, diffuse = _shares(material)
    m = sample_normal(ggx_facets(material.roughness, material.anisotropic), wo, numbers)
    m_coat = coat_normal(material.clearcoat_gloss, numbers.x, numbers.y)
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    by_coat = numbers.choice < diffuse + coated
    wi = reflect(wo, select3(by_coat, m_coat, m))
    wi = select3(numbers.choice < diffuse, scattered, wi)
    f_cos, pdf = eval_pdf(material, wo, wi)
    weight = select(pdf > 0.0, 1.0 / pdf, 0.0)
    return BsdfSample(wi, _finite(f_cos, weight), pdf, splat_f32(1.0))


@kernel
def _finite(f_cos, weight):
    return select3(weight > 0.0, f_cos * weight, no_light())


@kernel
def albedo(material):
    """Return the base colour, as in Mitsuba."""
    return material.base_color


# --------------------------------------------------------------------- with transmission


@kernel
def _glass_shares(glass, fresnel, front):
    """Return lobe probabilities: specular reflection, transmission, coat, diffuse."""
    through = (1.0 - glass.metallic) * glass.spec_trans
    rate = select(front, glass.main_specular_sampling_rate, 1.0)
    bent = rate * select(front, through, 1.0) * (1.0 - fresnel)
    mirrored = rate - bent
    coated = 0.25 * glass.clearcoat * glass.clearcoat_sampling_rate
    diffuse = (1.0 - glass.metallic) * (1.0 - glass.spec_trans)
    diffuse = diffuse * glass.diffuse_reflectance_sampling_rate
    coated, diffuse = select(front, coated, 0.0), select(front, diffuse, 0.0)
    scale = 1.0 / (mirrored + bent + coated + diffuse)
    return mirrored * scale, bent * scale, coated * scale, diffuse * scale


@kernel
def glass_eval_pdf(glass, wo, wi):
    """Return f |cos| and the pdf [1/sr]."""
    facets = ggx_facets(glass.roughness, glass.anisotropic)
    front, same_side = wo.z > 0.0, wo.z * wi.z > 0.0
    crossing = select(front, glass.eta, 1.0 / glass.eta)
    h = normalize(wo + wi * select(same_side, 1.0, crossing))
    h = select3(h.z < 0.0, -h, h)
    cos_o, cos_i = dot(wo, h), dot(wi, h)
    fresnel, _, _ = fresnel_dielectric(cos_o, glass.eta)
    through = (1.0 - glass.metallic) * glass.spec_trans
    # the facet's normal must be on wo's side for wo and on wi's side for wi
    mirrors = same_side & (cos_o * wo.z > 0.0) & (cos_i * wo.z > 0.0)
    bends = ~same_side & (cos_o * wo.z > 0.0) & (cos_i * wo.z < 0.0)
    bend = cos_o + crossing * cos_i
    bent_cosines = cos_o * cos_i / (bend * bend)

    shown = unshadowed(facets, wo, h) * unshadowed(facets, wi, h)
    density = normal_density(facets, h) * shown / fabs(wo.z)
    reflected = _reflected_glass(glass, fresnel, cos_o, front, through) * (0.25 * density)
    base = glass.base_color
    root = vec3(sqrt(base.x), sqrt(base.y), sqrt(base.z))
    refracted = root * (through * (1.0 - fresnel) * density * fabs(bent_cosines))
    color = select3(mirrors, reflected, no_light())
    color = select3(bends, refracted, color)
    above = front & (wi.z > 0.0)
    coated = coat(glass, wo, wi, h, schlick_weight(cos_o, glass.eta))
    matt = _diffuse(glass, (1.0 - glass.metallic) * (1.0 - glass.spec_trans), wo, wi, cos_i)
    color = select3(above, color + matt + select(mirrors, coated, 0.0), color)

    mirror, passing, coat_share, diffuse = _glass_shares(glass, fresnel, front)
    seen = normal_pdf(facets, select3(front, wo, -wo), h)
    coat_pdf = coat_density(glass.clearcoat_gloss, h) * h.z
    pdf = select(
        mirrors, (mirror * seen + coat_share * coat_pdf) / (4.0 * fabs(cos_i)), 0.0
    )
    turned = crossing * crossing * fabs(cos_i) / (bend * bend)
    pdf = select(bends, passing * seen * turned, pdf)
    pdf = pdf + select(above, diffuse * INV_PI * wi.z, 0.0)
    possible = (wo.z != 0.0) & (front | (through > 0.0))
    return select3(possible, color, no_light()), select(possible, pdf, 0.0)


@kernel
def _reflected_glass(glass, fresnel, cos_o, front, through):
    """Return the reflectance of the facets; from inside without metal and tint."""
    color = _reflected(glass, fresnel, cos_o)
    inside = through * fresnel
    return select3(front, color, vec3(inside, inside, inside))


@kernel
def glass_sample(glass, wo, numbers):
    """Sample a direction from one of the lobes; the weight is that of all lobes."""
    front = wo.z > 0.0
    facets = ggx_facets(glass.roughness, glass.anisotropic)
    m = sample_normal(facets, select3(front, wo, -wo), numbers)
    fresnel, cos_t, crossing = fresnel_dielectric(dot(wo, m), glass.eta)
    _, passing, coated, diffuse = _glass_shares(glass, fresnel, front)
    m_coat = coat_normal(glass.clearcoat_gloss, numbers.x, numbers.y)
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)

    by_coat = numbers.choice < diffuse + coated
    through = ~by_coat & (numbers.choice < diffuse + coated + passing)
    wi = reflect(wo, select3(by_coat, m_coat, m))
    bent = m * (dot(wo, m) / crossing + cos_t) - wo * (1.0 / crossing)
    wi = select3(through, bent, wi)
    scatters = numbers.choice < diffuse
    wi = select3(scatters, scattered, wi)
    f_cos, pdf = glass_eval_pdf(glass, wo, wi)
    # a refracted direction must be on the other side, a reflected one on the same side
    right_side = select(through & ~scatters, -wi.z, wi.z) * wo.z > 0.0
    weight = select((pdf > 0.0) & right_side, 1.0 / pdf, 0.0)
    eta = select(through & ~scatters, crossing, 1.0)
    return BsdfSample(wi, _finite(f_cos, weight), pdf, eta)


PRINCIPLED_GLASS = BsdfKind(
    TRANSMITTING,
    PrincipledGlass,
    read,
    "many materials in one, light goes through",
    glass_sample,
    glass_eval_pdf,
    albedo=albedo,
    transmits=True,
    oriented=True,
    reaches_all=samples_each_lobe,
)
PRINCIPLED = BsdfKind(
    "principled",
    Principled,
    read,
    "many materials in one",
    sample,
    eval_pdf,
    albedo=albedo,
    oriented=True,
    variants=(PRINCIPLED_GLASS,),
    reaches_all=samples_each_lobe,
)
