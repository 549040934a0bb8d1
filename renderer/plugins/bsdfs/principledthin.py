"""Principled BSDF of thin sheets [Burley2015]: symmetric, without refraction."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select, splat_f32
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
from renderer.plugins.bsdfs.principled import albedo, read_common, samples_each_lobe
from renderer.plugins.bsdfs.principled_lobes import (
    diffuse_shape,
    ggx_facets,
    no_light,
    schlick_weight,
    sheen_of,
    tinted_reflectance,
)
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_scalar_texture


class PrincipledThin(NamedTuple):
    """Its parameters."""

    base_color: Color
    roughness: Float
    anisotropic: Float
    spec_trans: Float
    spec_tint: Float
    sheen: Float
    sheen_tint: Float
    flatness: Float
    diff_trans: Float  # [0, 2] diffuse transmission; 1: half of the diffuse light
    eta: Float
    specular_reflectance_sampling_rate: Float
    specular_transmittance_sampling_rate: Float
    diffuse_reflectance_sampling_rate: Float
    diffuse_transmittance_sampling_rate: Float


_SCALARS = (
    "anisotropic",
    "spec_trans",
    "spec_tint",
    "sheen",
    "sheen_tint",
    "flatness",
    "diff_trans",
)
_RATES = PrincipledThin._fields[-4:]


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    eta = {"eta": read_scalar_texture(properties, "eta", 1.5)}
    return OtherBsdf("principledthin", eta | read_common(properties, _SCALARS, _RATES))


@kernel
def _shares(thin):
    """Return lobe probabilities: specular and diffuse reflection and transmission."""
    diffuse, through = 1.0 - thin.spec_trans, 0.5 * thin.diff_trans
    a = 0.5 * thin.spec_trans * thin.specular_reflectance_sampling_rate
    b = 0.5 * thin.spec_trans * thin.specular_transmittance_sampling_rate
    c = diffuse * (1.0 - through) * thin.diffuse_reflectance_sampling_rate
    d = diffuse * through * thin.diffuse_transmittance_sampling_rate
    scale = 1.0 / (a + b + c + d)
    return a * scale, b * scale, c * scale, d * scale


@kernel
def _bent_facets(thin):
    """Return the facets for transmission: with two refractions the lobe is narrower."""
    return ggx_facets(thin.roughness * (0.65 * thin.eta - 0.35), thin.anisotropic)


@kernel
def _on_the_side_of(v, of):
    """Return v, with z negated where `of` is on the back."""
    return select3(of.z < 0.0, -v, v)


@kernel
def eval_pdf(thin, wo, wi):
    """Return f |cos|, and the density [1/sr] with which `sample` chooses wi."""
    a, b = _on_the_side_of(wo, wo), _on_the_side_of(wi, wo)
    reflected = b.z > 0.0
    mirrored = vec3(b.x, b.y, fabs(b.z))
    h = normalize(a + mirrored)
    cos_o, cos_i = dot(a, h), dot(b, h)
    fresnel, _, _ = fresnel_dielectric(cos_o, thin.eta)
    facets, bent = ggx_facets(thin.roughness, thin.anisotropic), _bent_facets(thin)
    meets = select(reflected, cos_i, -cos_i) > 0.0

    weight = schlick_weight(cos_o, thin.eta)
    tinted = tinted_reflectance(thin.base_color, thin.eta, weight)
    color = (tinted - fresnel) * thin.spec_tint + fresnel
    shown = unshadowed(facets, a, h) * unshadowed(facets, b, h)
    mirror = color * (thin.spec_trans * normal_density(facets, h) * shown / (4.0 * a.z))
    shown = unshadowed(bent, a, h) * unshadowed(bent, b, h)
    passing = normal_density(bent, h) * shown / (4.0 * a.z)
    passed = thin.base_color * (thin.spec_trans * (1.0 - fresnel) * passing)
    specular = select3(reflected, mirror, passed)
    specular = select3(meets, specular, no_light())

    rest, through = 1.0 - thin.spec_trans, 0.5 * thin.diff_trans
    base = thin.base_color * (INV_PI * diffuse_shape(thin, a.z, b.z, cos_i))
    back = (base + sheen_of(thin, cos_i)) * (rest * (1.0 - through))
    onward = thin.base_color * (rest * through * INV_PI)
    color = specular + select3(reflected, back, onward) * fabs(b.z)

    mirrors, passes, scatters, diffuses = _shares(thin)
    pdf = select(
        reflected, mirrors * normal_pdf(facets, a, h), passes * normal_pdf(bent, a, h)
    )
    pdf = select(meets, pdf / (4.0 * fabs(dot(mirrored, h))), 0.0)
    pdf = pdf + select(reflected, scatters, diffuses) * INV_PI * fabs(b.z)
    possible = (wo.z != 0.0) & (wi.z != 0.0)
    return select3(possible, color, no_light()), select(possible, pdf, 0.0)


@kernel
def sample(thin, wo, numbers):
    """Sample a direction from one of the lobes; the weight is that of all lobes."""
    mirrors, passes, scatters, _ = _shares(thin)
    front = _on_the_side_of(wo, wo)
    facets = ggx_facets(thin.roughness, thin.anisotropic)
    mirrored = reflect(front, sample_normal(facets, front, numbers))
    m = sample_normal(_bent_facets(thin), front, numbers)
    bent = reflect(front, m)
    bent = vec3(bent.x, bent.y, -bent.z)
    scattered = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    choice = numbers.choice
    wi = select3(choice < mirrors + passes + scatters, scattered, -scattered)
    wi = select3(choice < mirrors + passes, bent, wi)
    wi = select3(choice < mirrors, mirrored, wi)
    returns = (choice < mirrors) | (
        (choice >= mirrors + passes) & (choice < mirrors + passes + scatters)
    )
    # samples on the wrong side of their facet are invalid, as in Mitsuba
    failed = (choice >= mirrors) & (choice < mirrors + passes) & (dot(bent, m) >= 0.0)
    right_side = (select(returns, wi.z, -wi.z) > 0.0) & ~failed
    wi = _on_the_side_of(wi, wo)
    f_cos, pdf = eval_pdf(thin, wo, wi)
    some = (pdf > 0.0) & right_side
    weight = f_cos * select(some, 1.0 / pdf, 0.0)
    return BsdfSample(wi, select3(some, weight, no_light()), pdf, splat_f32(1.0))


PRINCIPLEDTHIN = BsdfKind(
    "principledthin",
    PrincipledThin,
    read,
    "many thin sheets in one",
    sample,
    eval_pdf,
    albedo=albedo,
    transmits=True,
    oriented=True,
    reaches_all=samples_each_lobe,
)
