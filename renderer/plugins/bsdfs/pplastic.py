"""Plastic of Mitsuba's `pplastic`, without polarization: a rough coat over a diffuse base.

The transmittance of the coat is that of a smooth interface. Interreflection between base
and coat is ignored, unlike in `roughplastic`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.plugins.bsdfs.dielectric import LARGEST_INDEX, read_relative_index
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfKind, Color, Float, albedo_at_normal_incidence
from renderer.plugins.bsdfs.plastic import read_reflectances
from renderer.plugins.bsdfs.roughness import read_roughness
from renderer.plugins.bsdfs.roughplastic import coated_sample, eval_coated, sample_coated
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_scalar_texture

_POLYPROPYLENE = 1.49 / 1.000277  # in air


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
        eta = read_scalar_texture(properties, "eta", _POLYPROPYLENE)
        if not isinstance(eta, float) or not 1.0 / LARGEST_INDEX <= eta <= LARGEST_INDEX:
            found = f"{eta:g}" if isinstance(eta, float) else "a texture"
            possible = f"a number from {1.0 / LARGEST_INDEX:g} to {LARGEST_INDEX:g}"
            properties.fail("eta", found, possible)
    else:
        eta = read_relative_index(properties, "polypropylene", rough=True)
    values = {"eta": eta} | read_reflectances(properties)
    return OtherBsdf("pplastic", read_roughness(properties) | values)


@kernel
def eval_pdf(plastic, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    back, _, _ = fresnel_dielectric(wo.z, plastic.eta)
    ahead, _, _ = fresnel_dielectric(wi.z, plastic.eta)
    passes, share = (1.0 - back) * (1.0 - ahead), plastic.specular_share
    return eval_coated(plastic, plastic.diffuse_reflectance, passes, share, wo, wi)


@kernel
def sample(plastic, wo, numbers):
    """Mirror at a facet of the coat, or scatter from the base."""
    wi = sample_coated(plastic, plastic.specular_share, wo, numbers)
    f_cos, pdf = eval_pdf(plastic, wo, wi)
    return coated_sample(wi, f_cos, pdf)


PPLASTIC = BsdfKind(
    "pplastic",
    PPlastic,
    read,
    "a diffuse base under a rough coat, polarization left out",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
    oriented=True,
)
