"""Microfacet distributions: Beckmann and Trowbridge-Reitz (GGX), anisotropic.

They have separable shadowing, and two ways to sample a normal: all normals, or the normals
visible from wo [Walter2007; Heitz2014]. The distribution is a number at each point, not a
type: a scene of mixed materials has one kind. The branch has no measurable cost (rough
metal with GGX: 6.5 ns per evaluation and 14 ns per sample, with Beckmann's code or
without). Beckmann's code takes 0.7 s to compile, once on a machine.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, mask_bits, maximum, minimum, select, sqrt
from renderer.kernels.lanes.mathematics import erf, erfinv, exp, log, sincos
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.sampling.numbers_and_warps import TWO_PI, cosine_direction

PI = np.float32(np.pi)
_INV_SQRT_PI = np.float32(1.0 / np.sqrt(np.pi))
_SMOOTHEST = np.float32(1e-4)  # a smaller roughness has no accurate digits in float32
_NO_DENSITY = np.float32(1e-20)  # a smaller density of normals counts as 0
_FLAT2 = np.float32(4 * 2.0**-24)  # squared sine below which wo counts as the normal
_END = np.float32(1e-6)  # random numbers are clamped to this distance from 0 and 1


class Microfacets(NamedTuple):
    """The distribution at 16 points; directions are local, z is the mean normal."""

    alpha_u: Any  # roughness along x: sqrt(2) times the root mean square slope
    alpha_v: Any  # and along y
    beckmann: Any  # mask; elsewhere GGX
    every_normal: Any  # mask: all normals are sampled, not only visible ones


@kernel
def microfacets(rough):
    """Return the distribution for a record of parameters."""
    return Microfacets(
        maximum(rough.alpha_u, _SMOOTHEST),
        maximum(rough.alpha_v, _SMOOTHEST),
        rough.beckmann != 0.0,
        rough.every_normal != 0.0,
    )


@kernel
def normal_density(facets, m):
    """Return D(m): area of facets with normal m per solid angle and macrosurface area."""
    x, y, z2 = m.x / facets.alpha_u, m.y / facets.alpha_v, m.z * m.z
    slope2 = x * x + y * y
    area = PI * facets.alpha_u * facets.alpha_v
    density = 1.0 / (area * (slope2 + z2) * (slope2 + z2))
    if mask_bits(facets.beckmann) != 0:
        gaussian = exp(-(slope2 / z2)) / (area * z2 * z2)
        density = select(facets.beckmann, gaussian, density)
    return select(density * m.z > _NO_DENSITY, density, 0.0)


@kernel
def unshadowed(facets, v, m):
    """Return G1: the fraction of facets with normal m that is visible from v.

    Beckmann's by the rational fit of [Walter2007, eq. 27].
    """
    x, y = facets.alpha_u * v.x, facets.alpha_v * v.y
    across2 = x * x + y * y
    tan2 = across2 / (v.z * v.z)
    seen = 2.0 / (1.0 + sqrt(1.0 + tan2))
    if mask_bits(facets.beckmann) != 0:
        a = 1.0 / sqrt(tan2)
        fit = (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
        seen = select(facets.beckmann, select(a >= 1.6, 1.0, fit), seen)
    seen = select(across2 == 0.0, 1.0, seen)
    return select(dot(v, m) * v.z > 0.0, seen, 0.0)  # a facet's back is not visible


@kernel
def normal_pdf(facets, wo, m):
    """Return the pdf [1/sr] of `sample_normal`; wo.z > 0."""
    density = normal_density(facets, m)
    seen = density * unshadowed(facets, wo, m) * fabs(dot(wo, m)) / wo.z
    return select(facets.every_normal, density * m.z, seen)


@kernel
def sample_normal(facets, wo, numbers):
    """Sample a microfacet normal m, m.z > 0; wo.z > 0."""
    m = _visible_normal(facets, wo, numbers)
    if mask_bits(facets.every_normal) != 0:
        m = select3(facets.every_normal, _any_normal(facets, numbers), m)
    return m


@kernel
def _any_normal(facets, numbers):
    """Sample D(m) m.z [Walter2007, eqs. 28, 29 and 35, 36]; elliptic if anisotropic."""
    sine, cosine = sincos(TWO_PI * numbers.y)
    u, v = facets.alpha_u * cosine, facets.alpha_v * sine
    # azimuth of (cos phi / alpha_u, sin phi / alpha_v), normalised
    stretch = 1.0 / sqrt(u * u + v * v)
    cos_phi, sin_phi = u * stretch, v * stretch
    x, y = cos_phi / facets.alpha_u, sin_phi / facets.alpha_v
    alpha2 = 1.0 / (x * x + y * y)
    tan2 = alpha2 * numbers.x / (1.0 - numbers.x)
    if mask_bits(facets.beckmann) != 0:
        tan2 = select(facets.beckmann, -(alpha2 * log(1.0 - numbers.x)), tan2)
    z = 1.0 / sqrt(1.0 + tan2)
    across = sqrt(maximum(1.0 - z * z, 0.0))
    return vec3(cos_phi * across, sin_phi * across, z)


@kernel
def _visible_normal(facets, wo, numbers):
    """Sample the normals visible from wo: stretch to alpha 1, sample a slope, unstretch."""
    v = vec3(facets.alpha_u * wo.x, facets.alpha_v * wo.y, wo.z)
    # Mitsuba's order of summation. The sine of a polished surface is one of few numbers:
    # it comes from the last bits of v.z.
    v = v * (1.0 / sqrt((v.x * v.x + v.z * v.z) + v.y * v.y))
    across2 = v.x * v.x + v.y * v.y
    flat = across2 <= _FLAT2
    scale = 1.0 / sqrt(across2)
    cos_phi = select(flat, 1.0, minimum(maximum(v.x * scale, -1.0), 1.0))
    sin_phi = select(flat, 0.0, minimum(maximum(v.y * scale, -1.0), 1.0))
    along, across = _ggx_slopes(v.z, numbers)
    if mask_bits(facets.beckmann) != 0:
        a, b = _beckmann_slopes(v.z, numbers)
        along = select(facets.beckmann, a, along)
        across = select(facets.beckmann, b, across)
    x = facets.alpha_u * (cos_phi * along - sin_phi * across)
    y = facets.alpha_v * (sin_phi * along + cos_phi * across)
    return normalize(vec3(-x, -y, x * 0.0 + 1.0))


@kernel
def _ggx_slopes(cosine, numbers):
    """Return slopes parallel and perpendicular to wo for alpha 1 [Heitz2018].

    A point of the disk, with its upper part scaled to the projected hemisphere. The
    assignment of its axes is Mitsuba's, so that equal random numbers give equal normals.
    """
    disk = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    share = 0.5 * (1.0 + cosine)
    x = disk.x
    y = (1.0 - share) * sqrt(maximum(1.0 - x * x, 0.0)) + share * disk.y
    z = sqrt(maximum(1.0 - x * x - y * y, 0.0))
    sine = sqrt(maximum(1.0 - cosine * cosine, 0.0))
    scale = 1.0 / (sine * y + cosine * z)
    return (cosine * y - sine * z) * scale, x * scale


@kernel
def _beckmann_slopes(cosine, numbers):
    """Return slopes parallel and perpendicular to wo for alpha 1 [Jakob2014].

    The cumulative distribution of the slope along wo is inverted by Newton's method, in the
    error function of that slope; three steps, as in Mitsuba.
    """
    tangent = sqrt(maximum(1.0 - cosine * cosine, 0.0)) / cosine
    cotangent = 1.0 / tangent
    most = erf(cotangent)
    u = minimum(maximum(numbers.x, _END), 1.0 - _END)
    v = minimum(maximum(numbers.y, _END), 1.0 - _END)
    scale = tangent * _INV_SQRT_PI
    target = u * (1.0 + most + scale * exp(-(cotangent * cotangent)))
    x = most - (1.0 + most) * erf(sqrt(-log(u)))
    for _ in range(3):
        slope = erfinv(x)
        value = 1.0 + x + scale * exp(-(slope * slope)) - target
        x = x - value / (1.0 - slope * tangent)
    return erfinv(x), erfinv(2.0 * v - 1.0)
