"""Lobes of hair [Chiang2016]: how much light each has, and around which direction.

A direction has the longitudinal angle theta to the plane across the fibre, sin theta = y,
and an azimuth phi in this plane. There are four lobes: R, reflected; TT, refracted through
the fibre; TRT, reflected inside once; and all longer paths. Each has an attenuation A, a
longitudinal part M [DEon2011b] and an azimuthal part N: a logistic distribution, or for the
last lobe a constant.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
    to_double,
    to_single,
)
from renderer.kernels.lanes.mathematics import arccos, exp, log, sincos
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.microfacets import PI
from renderer.plugins.sampling.numbers_and_warps import TWO_PI
from renderer.plugins.textures.kind import LUMINANCE

_RED, _GREEN, _BLUE = (np.float32(x) for x in LUMINANCE)
_HALF_PI = np.float32(0.5 * np.pi)
_INV_TWO_PI = np.float32(0.5 / np.pi)
_TURN = float(np.float32(2.0 * np.pi))  # Mitsuba's, for arithmetic in double precision
_SMOOTH = np.float32(10.0)  # 1 / v above which M is computed by logarithms
_LOG_2 = np.float32(0.6931)  # Mitsuba's digits
# 1 / (4^k k!^2): the series of I0(x) in x^2, by which Mitsuba goes up to x = 12
_BESSEL = tuple(np.float32(1.0 / (4.0**k * math.factorial(k) ** 2)) for k in range(11))
_FAR = np.float32(12.0)
_THIRD, _SIXTIETH = np.float32(1.0 / 3.0), np.float32(1.0 / 60.0)


# ------------------------------------------------------------------------ longitudinal, M


@kernel
def other_leg(sine):
    """Return sqrt(1 - sine^2); the square is not rounded, as where Mitsuba fuses it."""
    wide = to_double(sine)
    return sqrt(maximum(to_single(1.0 - wide * wide), splat_f32(0.0)))


@kernel
def _bessel(x):
    """Return I0 of 0 <= x <= 12, the modified Bessel function."""
    square = x * x
    power, total = square, 1.0 + square * _BESSEL[1]
    for k in range(2, len(_BESSEL)):
        power = power * square
        total = total + power * _BESSEL[k]
    return total


@kernel
def _log_bessel(x):
    """Return log I0(x); above 12 by Mitsuba's expansion, 1 / (16 x) too small."""
    far = x + 0.5 * (log(1.0 / (TWO_PI * x)) + 1.0 / (8.0 * x))
    return select(x > _FAR, far, log(_bessel(minimum(x, _FAR))))


@kernel
def longitudinal(sin_o, sin_i, v):
    """Return M / (2 pi), a density [1/sr] around the fibre [DEon2011b].

    In the exponent large terms cancel if a fibre is smooth. Their order is Mitsuba's. M is
    off by 1e-5 at a longitudinal roughness of 0.1, and by 1e-3 at 0.01.
    """
    kappa = 1.0 / v
    k2 = kappa * kappa
    c = other_leg(sin_o) * other_leg(sin_i) * kappa
    s = sin_o * sin_i * kappa
    smooth = exp(-s + _log_bessel(c) - kappa + _LOG_2 + log(0.5 * kappa))
    width = exp(kappa) - exp(-kappa)  # 2 sinh(kappa), and kappa over it
    over = select(kappa < 0.5, 1.0 / (2.0 + k2 * (_THIRD + k2 * _SIXTIETH)), kappa / width)
    rough = exp(-s) * _bessel(minimum(c, _SMOOTH)) * over
    return select(kappa > _SMOOTH, smooth, rough) * _INV_TWO_PI


# --------------------------------------------------------------------------- azimuthal, N


@kernel
def _logistic_below(x, s):
    """Return the logistic distribution function."""
    return 1.0 / (1.0 + exp(-x / s))


@kernel
def azimuthal(turn, s):
    """Return the density [1/rad] of an azimuth off that of a smooth fibre."""
    wide = to_double(turn)
    rest = to_single(wide - floor(wide / _TURN + 0.5) * _TURN)  # in [-pi, pi]
    fallen = exp(-fabs(rest) / s)
    density = fallen / (s * ((1.0 + fallen) * (1.0 + fallen)))
    return density / (_logistic_below(PI, s) - _logistic_below(-PI, s))


@kernel
def sample_azimuth(number, s):
    """Return an azimuth in [-pi, pi] of this density."""
    first = _logistic_below(-PI, s)
    k = _logistic_below(PI, s) - first
    x = -s * log(1.0 / (number * k + first) - 1.0)
    return maximum(minimum(x, PI), -PI)


# -------------------------------------------------------------------------------- lobes


class Lobe(NamedTuple):
    """What a lobe is around, for one wo."""

    attenuation: Any  # A, RGB
    share: Any  # of samples: that of the luminance of A
    sine: Any  # of theta of wo, turned by the scales of the hair
    cosine: Any  # not negative
    variance: Any
    azimuth: Any  # by which a smooth fibre turns the light


@kernel
def _attenuations(hair, sin_o, cos_o, offset, sin_gamma_t):
    """Return A of the four lobes, RGB [Chiang2016]."""
    none = splat_f32(0.0)
    cos_gamma = sqrt(maximum(1.0 - offset * offset, none))
    cos_gamma_t = sqrt(maximum(1.0 - sin_gamma_t * sin_gamma_t, none))
    sin_t = sin_o / hair.eta
    cos_t = sqrt(maximum(1.0 - sin_t * sin_t, none))
    length = 2.0 * cos_gamma_t / cos_t
    fresnel, _, _ = fresnel_dielectric(cos_o * cos_gamma, hair.eta)
    depth = (hair.sigma_a * hair.scale) * -length
    passed = vec3(exp(depth.x), exp(depth.y), exp(depth.z))
    once = passed * ((1.0 - fresnel) * (1.0 - fresnel))
    inside = passed * fresnel
    twice = once * inside
    all_more = vec3(  # a geometric series
        twice.x * inside.x / (1.0 - inside.x),
        twice.y * inside.y / (1.0 - inside.y),
        twice.z * inside.z / (1.0 - inside.z),
    )
    return vec3(fresnel, fresnel, fresnel), once, twice, all_more


@kernel
def _luminance(a):
    return _RED * a.x + _GREEN * a.y + _BLUE * a.z


@kernel
def _turned(sin_o, cos_o, sine, cosine):
    """Return sine and |cosine| of a sum of two angles."""
    return sin_o * cosine + cos_o * sine, fabs(cos_o * cosine - sin_o * sine)


@kernel
def lobes_of(hair, wo):
    """Return the four lobes for wo."""
    across = sqrt(wo.x * wo.x + wo.z * wo.z)
    gamma = select(across == 0.0, 0.0, arccos(wo.z / across))
    gamma = select(wo.x < 0.0, gamma, -gamma)
    # h; gamma near 0 and its cosine near 90 degrees lose digits, the same as in Mitsuba
    offset, _ = sincos(gamma)
    sin_o, cos_o = wo.y, other_leg(wo.y)
    # across the fibre its index of refraction is larger [Marschner2003, appendix B]
    eta2 = maximum(hair.eta * hair.eta - sin_o * sin_o, splat_f32(0.0))
    sin_gamma_t = offset / (sqrt(eta2) / cos_o)
    gamma_t = _HALF_PI - arccos(sin_gamma_t)

    a0, a1, a2, a3 = _attenuations(hair, sin_o, cos_o, offset, sin_gamma_t)
    y0, y1, y2, y3 = _luminance(a0), _luminance(a1), _luminance(a2), _luminance(a3)
    total = y0 + y1 + y2 + y3

    # the scales turn R by -2 tilt, TT by the tilt, TRT by 4 tilt
    s1, c1 = hair.sin_tilt, hair.cos_tilt
    s2, c2 = 2.0 * c1 * s1, c1 * c1 - s1 * s1
    s4, c4 = 2.0 * c2 * s2, c2 * c2 - s2 * s2
    sine_0, cosine_0 = _turned(sin_o, cos_o, -s2, c2)
    sine_1, cosine_1 = _turned(sin_o, cos_o, s1, c1)
    sine_2, cosine_2 = _turned(sin_o, cos_o, s4, c4)
    turn_1 = 2.0 * gamma_t - 2.0 * gamma + PI
    turn_2 = 4.0 * gamma_t - 2.0 * gamma + TWO_PI
    v = hair.variance
    return (
        Lobe(a0, y0 / total, sine_0, cosine_0, v, -2.0 * gamma),
        Lobe(a1, y1 / total, sine_1, cosine_1, 0.25 * v, turn_1),
        Lobe(a2, y2 / total, sine_2, cosine_2, 4.0 * v, turn_2),
        Lobe(a3, y3 / total, sin_o, cos_o, 4.0 * v, gamma),  # in all azimuths
    )
