"""Lobes of the principled BSDFs [Burley2012; Burley2015], weighted as in Mitsuba.

Directions are local; `cos_o` is the cosine of the half vector and wo, `cos_i` that with wi.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import exp, log, sincos
from renderer.kernels.lanes.vectors import dot, select3, vec3
from renderer.plugins.bsdfs.microfacets import Microfacets
from renderer.plugins.sampling.numbers_and_warps import INV_PI, TWO_PI

_SMOOTHEST = np.float32(1e-3)
_NO_DENSITY = np.float32(1e-20)  # a smaller density of normals counts as 0
_COAT_REFLECTANCE = np.float32(0.04)  # of the clear coat at normal incidence
_COAT_ALPHA2 = np.float32(0.25**2)  # in its shadowing, for any gloss


@kernel
def no_light():
    """Return black."""
    none = splat_f32(0.0)
    return vec3(none, none, none)


@kernel
def between(a, b, t):
    """Return the linear interpolation: a at t = 0, b at t = 1."""
    return a + (b - a) * t


@kernel
def ggx_facets(roughness, anisotropic):
    """Return the microfacet distribution for a perceptual roughness."""
    aspect = sqrt(1.0 - 0.9 * anisotropic)
    alpha = roughness * roughness
    never = roughness != roughness
    return Microfacets(
        maximum(alpha / aspect, _SMOOTHEST),
        maximum(alpha * aspect, _SMOOTHEST),
        never,
        never,
    )


@kernel
def fifth_power_of_rest(cosine):
    """Return (1 - cosine)^5, the weight of Schlick's approximation."""
    rest = minimum(maximum(1.0 - cosine, 0.0), 1.0)
    square = rest * rest
    return square * square * rest


@kernel
def schlick_weight(cosine, eta):
    """Return the Schlick weight: reflectance is F0 at 0 and 1 at 1."""
    crossing = select(cosine >= 0.0, eta, 1.0 / eta)
    cos2_t = 1.0 - (1.0 - cosine * cosine) / (crossing * crossing)
    refracted = sqrt(maximum(cos2_t, 0.0))
    return fifth_power_of_rest(select(crossing > 1.0, fabs(cosine), refracted))


@kernel
def tint_of(color):
    """Return the colour divided by its luminance; white for black."""
    luminance = 0.212671 * color.x + 0.715160 * color.y + 0.072169 * color.z
    some = luminance > 0.0
    one = splat_f32(1.0)
    return select3(some, color / select(some, luminance, 1.0), vec3(one, one, one))


@kernel
def tinted_reflectance(color, crossing, weight):
    """Return Schlick's reflectance of a dielectric with tinted F0."""
    ratio = (crossing - 1.0) / (crossing + 1.0)
    return tint_of(color) * (ratio * ratio * (1.0 - weight)) + weight


@kernel
def sheen_of(material, cos_i):
    """Return the sheen lobe without the cosine."""
    white = tint_of(material.base_color) - 1.0
    return (white * material.sheen_tint + 1.0) * (
        material.sheen * fifth_power_of_rest(fabs(cos_i))
    )


@kernel
def diffuse_shape(material, cos_wo, cos_wi, cos_i):
    """Return the diffuse f over base / pi: retro-reflection, or flat scattering."""
    out, into = fifth_power_of_rest(cos_wi), fifth_power_of_rest(cos_wo)
    back = 2.0 * material.roughness * cos_i * cos_i
    diffuse = (1.0 - 0.5 * into) * (1.0 - 0.5 * out)
    retro = back * (out + into + out * into * (back - 1.0))
    scale = between(1.0, 0.5 * back, out) * between(1.0, 0.5 * back, into)
    flat = 1.25 * (scale * (1.0 / (cos_wi + cos_wo) - 0.5) + 0.5)
    return between(diffuse + retro, flat, material.flatness)


# ------------------------------------------------------------------------- the clear coat


@kernel
def _coat_alpha2(gloss):
    alpha = 0.1 - 0.099 * gloss
    return alpha * alpha


@kernel
def coat_density(gloss, m):
    """Return D(m) of the coat, with the long tail of [Burley2012]."""
    alpha2 = _coat_alpha2(gloss)
    shape = log(alpha2) * (1.0 + (alpha2 - 1.0) * m.z * m.z)
    density = INV_PI * (alpha2 - 1.0) / shape
    return select(density * m.z > _NO_DENSITY, density, 0.0)


@kernel
def _coat_shadowing(v, m):
    tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z)
    seen = 2.0 / (1.0 + sqrt(1.0 + _COAT_ALPHA2 * tan2))
    return select(dot(v, m) * v.z > 0.0, seen, 0.0)


@kernel
def coat(material, wo, wi, m, weight):
    """Return f cos of the clear coat; as in Mitsuba without the factor 1 / (4 cos cos)."""
    fresnel = between(_COAT_REFLECTANCE, 1.0, weight)
    shadowing = _coat_shadowing(wo, m) * _coat_shadowing(wi, m)
    density = coat_density(material.clearcoat_gloss, m)
    return 0.25 * material.clearcoat * fresnel * density * shadowing * fabs(wi.z)


@kernel
def coat_normal(gloss, x, y):
    """Sample a normal of the coat by D(m) cos; x gives the azimuth."""
    alpha2 = _coat_alpha2(gloss)
    cos2 = (1.0 - exp((1.0 - y) * log(alpha2))) / (1.0 - alpha2)
    sine = sqrt(maximum(1.0 - cos2, 0.0))
    sin_phi, cos_phi = sincos(TWO_PI * x)
    return vec3(sine * cos_phi, sine * sin_phi, sqrt(maximum(cos2, 0.0)))
