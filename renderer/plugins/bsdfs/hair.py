"""Hair and fur [Chiang2016]: light that passes a fibre in one scattering event.

The fibre runs along y. The longitudinal angle theta of a direction is that to the plane
across the fibre, sin theta = y; its azimuth phi is the angle in this plane. There are four
lobes: R (p = 0), reflected; TT (p = 1), refracted through the fibre; TRT (p = 2), reflected
inside once; and all longer paths (p = 3). Each has an attenuation A, a longitudinal part M
[DEon2011b] and an azimuthal part N, which is a logistic distribution; constant for p = 3.

The cosine of f |cos| is part of the model. The formulas are the same for all signs of z.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
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
from renderer.kernels.lanes.mathematics import arccos, arctan2, exp, log, sincos
from renderer.kernels.lanes.vectors import normalize, vec3
from renderer.plugins.bsdfs.dielectric import read_relative_index
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfKind, Color, Float
from renderer.plugins.bsdfs.roughplastic import coated_sample
from renderer.plugins.sampling.numbers_and_warps import AlongU, Plain
from renderer.plugins.textures.kind import LUMINANCE
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import ConstantTexture, OtherBsdf, Texture
from renderer.scene_file.objects.objects import read_texture

# absorption of a unit of pigment, per radius of the hair [DEon2011b]
_EUMELANIN = np.array([0.419, 0.697, 1.37])
_PHEOMELANIN = np.array([0.187, 0.4, 1.05])

_RED, _GREEN, _BLUE = (np.float32(x) for x in LUMINANCE)
_PI = np.float32(np.pi)
_HALF_PI = np.float32(0.5 * np.pi)
_TWO_PI = np.float32(2.0 * np.pi)
_INV_TWO_PI = np.float32(0.5 / np.pi)
_TWO_PI_AS_SINGLE = float(_TWO_PI)  # for arithmetic in double precision
_SMOOTHER = np.float32(10.0)  # 1 / v above which M is computed by logarithms
_LOG_2 = np.float32(0.6931)  # Mitsuba's digits
# 1 / (4^k k!^2), the series of I0(x) in x^2, up to x = 12
_BESSEL = tuple(np.float32(1.0 / (4.0**k * math.factorial(k) ** 2)) for k in range(11))
_ASYMPTOTIC = np.float32(12.0)
_THIRD, _SIXTIETH = np.float32(1.0 / 3.0), np.float32(1.0 / 60.0)


class Hair(NamedTuple):
    """Its parameters."""

    variance: Float  # v of p = 0; 1/4 of it for p = 1, 4 times for p = 2 and 3
    spread: Float  # scale of the logistic distribution [rad]
    sin_tilt: Float  # of the scales' angle
    cos_tilt: Float
    eta: Float  # index of refraction, inside over outside
    scale: Float  # of sigma_a
    sigma_a: Color  # absorption, per radius of the hair


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file."""
    along = properties.number("longitudinal_roughness", 0.3, at_least=0.0, at_most=1.0)
    around = properties.number("azimuthal_roughness", 0.3, at_least=0.0, at_most=1.0)
    sine = math.sin(math.radians(properties.number("scale_tilt", 2.0)))
    # [Chiang2016, eq. 7 and 8]
    roughness = 0.726 * along + 0.812 * along**2 + 3.7 * along**20
    spread = 0.265 * around + 1.194 * around**2 + 5.372 * around**22
    sigma_a, scale = _read_absorption(properties)
    values = {
        "variance": roughness**2,
        "spread": math.sqrt(math.pi / 8.0) * spread,
        "sin_tilt": sine,
        # Mitsuba's is not negative either: an angle above 90 degrees is one below
        "cos_tilt": math.sqrt(1.0 - sine * sine),
        "eta": read_relative_index(properties, "amber", rough=True),
        "scale": scale,
        "sigma_a": sigma_a,
    }
    return OtherBsdf("hair", values)


def _read_absorption(properties: Any) -> tuple[Texture, float]:
    """Return the absorption and its scale, which is that of `sigma_a` alone."""
    pigments = [name for name in ("eumelanin", "pheomelanin") if properties.has(name)]
    scale = properties.number("scale", 1.0, at_least=0.0)
    if not properties.has("sigma_a"):
        eumelanin = properties.number("eumelanin", 1.3, at_least=0.0)
        pheomelanin = properties.number("pheomelanin", 0.2, at_least=0.0)
        rgb = eumelanin * _EUMELANIN + pheomelanin * _PHEOMELANIN
        return ConstantTexture(tuple(rgb.tolist())), 1.0
    if pigments:
        properties.fail(pigments[0], 'a value together with "sigma_a"', "one of the two")
    sigma_a = read_texture(properties, "sigma_a", 0.0, Use.NUMBER)
    if isinstance(sigma_a, ConstantTexture) and min(sigma_a.rgb) < 0.0:
        properties.fail("sigma_a", f"{min(sigma_a.rgb):g}", "numbers of at least 0")
    return sigma_a, scale


# ------------------------------------------------------------------------ longitudinal, M


@kernel
def _other_leg(sine):
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
    far = x + 0.5 * (log(1.0 / (_TWO_PI * x)) + 1.0 / (8.0 * x))
    return select(x > _ASYMPTOTIC, far, log(_bessel(minimum(x, _ASYMPTOTIC))))


@kernel
def _longitudinal(sin_o, sin_i, v):
    """Return M / (2 pi), a density [1/sr] around the fibre [DEon2011b, section 3.2].

    For smooth fibres the large terms of the exponent cancel; their order is Mitsuba's.
    """
    kappa = 1.0 / v
    k2 = kappa * kappa
    c = _other_leg(sin_o) * _other_leg(sin_i) * kappa
    s = sin_o * sin_i * kappa
    smooth = exp(-s + _log_bessel(c) - kappa + _LOG_2 + log(0.5 * kappa))
    width = exp(kappa) - exp(-kappa)  # 2 sinh(kappa), and kappa over it
    over = select(kappa < 0.5, 1.0 / (2.0 + k2 * (_THIRD + k2 * _SIXTIETH)), kappa / width)
    rough = exp(-s) * _bessel(minimum(c, _SMOOTHER)) * over
    return select(kappa > _SMOOTHER, smooth, rough) * _INV_TWO_PI


# --------------------------------------------------------------------------- azimuthal, N


@kernel
def _logistic_below(x, s):
    """Return the logistic distribution function."""
    return 1.0 / (1.0 + exp(-x / s))


@kernel
def _azimuthal(turn, s):
    """Return the density [1/rad] of an azimuth off that of a smooth fibre."""
    # C's fmod, which keeps the sign; then to [-pi, pi]
    size = to_double(fabs(turn))
    rest = to_single(size - floor(size / _TWO_PI_AS_SINGLE) * _TWO_PI_AS_SINGLE)
    rest = select(turn < 0.0, -rest, rest)
    rest = select(rest < _PI, rest + _TWO_PI, rest)
    rest = select(rest > _PI, rest - _TWO_PI, rest)
    fallen = exp(-fabs(rest) / s)
    density = fallen / (s * ((1.0 + fallen) * (1.0 + fallen)))
    return density / (_logistic_below(_PI, s) - _logistic_below(-_PI, s))


@kernel
def _sample_azimuth(number, s):
    """Return an azimuth in [-pi, pi] of this density."""
    first = _logistic_below(-_PI, s)
    k = _logistic_below(_PI, s) - first
    x = -s * log(1.0 / (number * k + first) - 1.0)
    return maximum(minimum(x, _PI), -_PI)


# -------------------------------------------------------------------------------- lobes


class _Lobe(NamedTuple):
    """What a lobe is around, for one wo."""

    attenuation: Any  # A, RGB
    share: Any  # of samples: that of the luminance of A
    sine: Any  # of theta of wo, turned by the scales of the hair
    cosine: Any  # not negative
    variance: Any
    azimuth: Any  # by which a smooth fibre turns the light


@kernel
def _attenuations(hair, sin_o, cos_o, offset, sin_gamma_t):
    """Return A of the four lobes, RGB [Chiang2016, section 3.2]."""
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
    rest = twice * vec3(
        inside.x / (1.0 - inside.x),
        inside.y / (1.0 - inside.y),
        inside.z / (1.0 - inside.z),
    )
    return vec3(fresnel, fresnel, fresnel), once, twice, rest


@kernel
def _luminance(a):
    return _RED * a.x + _GREEN * a.y + _BLUE * a.z


@kernel
def _lobes(hair, wo):
    """Return the four lobes for wo."""
    across = sqrt(wo.x * wo.x + wo.z * wo.z)
    gamma = select(across == 0.0, 0.0, arccos(wo.z / across))
    gamma = select(wo.x < 0.0, gamma, -gamma)
    # h; gamma near 0 and its cosine near 90 degrees lose digits, the same as in Mitsuba
    offset, _ = sincos(gamma)
    sin_o, cos_o = wo.y, _other_leg(wo.y)
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
    sine_0, cosine_0 = sin_o * c2 - cos_o * s2, fabs(cos_o * c2 + sin_o * s2)
    sine_1, cosine_1 = sin_o * c1 + cos_o * s1, fabs(cos_o * c1 - sin_o * s1)
    sine_2, cosine_2 = sin_o * c4 + cos_o * s4, fabs(cos_o * c4 - sin_o * s4)
    turn_1 = 2.0 * gamma_t - 2.0 * gamma + _PI
    turn_2 = 4.0 * gamma_t - 2.0 * gamma + _TWO_PI
    v = hair.variance
    return (
        _Lobe(a0, y0 / total, sine_0, cosine_0, v, -2.0 * gamma),
        _Lobe(a1, y1 / total, sine_1, cosine_1, 0.25 * v, turn_1),
        _Lobe(a2, y2 / total, sine_2, cosine_2, 4.0 * v, turn_2),
        _Lobe(a3, y3 / total, sin_o, cos_o, 4.0 * v, gamma),  # in all azimuths
    )


# ------------------------------------------------------------------------------- kernels


@kernel
def _density(hair, lobe, sin_i, turn):
    """Return the density [1/sr] of a lobe at theta of wi and an azimuth from that of wo."""
    azimuthal = _azimuthal(turn - lobe.azimuth, hair.spread)
    return _longitudinal(lobe.sine, sin_i, lobe.variance) * _TWO_PI * azimuthal


@kernel
def _finite(x):
    """Return x, and 0 where it is NaN or infinite: fibres of roughness 0 are black."""
    return select(fabs(x) < math.inf, x, 0.0)


@kernel
def _eval_pdf(hair, lobes, wo, wi):
    """Return f |cos| and the pdf [1/sr]."""
    turn = arctan2(wi.z, wi.x) - arctan2(wo.z, wo.x)
    r, tt, trt, more = lobes
    d0 = _density(hair, r, wi.y, turn)
    d1 = _density(hair, tt, wi.y, turn)
    d2 = _density(hair, trt, wi.y, turn)
    d3 = _longitudinal(more.sine, wi.y, more.variance)
    pdf = d0 * r.share + d1 * tt.share + d2 * trt.share + d3 * more.share
    f = r.attenuation * d0 + tt.attenuation * d1 + trt.attenuation * d2
    f = f + more.attenuation * d3
    return vec3(_finite(f.x), _finite(f.y), _finite(f.z)), _finite(pdf)


@kernel
def eval_pdf(hair, wo, wi):
    """Return f |cos| and the pdf [1/sr]."""
    return _eval_pdf(hair, _lobes(hair, wo), wo, wi)


@interface
def theta_of_last_lobe(arithmetic: Any, sine: Any, cosine: Any) -> Any:
    """Return sine and cosine of the theta that samples of the last lobe are around.

    Those of wo. Mitsuba takes 0 for both, so that these samples are all across the fibre;
    a replay follows.
    """


@theta_of_last_lobe.by(Plain, AlongU)
@kernel
def _theta_of_last_lobe(arithmetic, sine, cosine):
    return sine, cosine


@kernel
def sample(hair, wo, numbers):
    """Choose a lobe by its share, then theta [DEon2011b] and the azimuth.

    `numbers.choice` is used for the lobe, and what is left of it for the azimuth.
    """
    r, tt, trt, more = lobes = _lobes(hair, wo)
    u0 = numbers.choice
    u1 = u0 - r.share
    u2 = u1 - tt.share
    u3 = u2 - trt.share
    is_1, is_2, is_3 = r.share < u0, tt.share < u1, trt.share < u2

    left = select(is_1, u1 / tt.share, u0 / r.share)
    left = select(is_3, u3 / more.share, select(is_2, u2 / trt.share, left))
    left = maximum(minimum(left, 1.0), 0.0)
    last = theta_of_last_lobe(numbers.arithmetic, more.sine, more.cosine)
    sine, cosine = select(is_1, tt.sine, r.sine), select(is_1, tt.cosine, r.cosine)
    sine = select(is_3, last[0], select(is_2, trt.sine, sine))
    cosine = select(is_3, last[1], select(is_2, trt.cosine, cosine))
    v = select(is_2, trt.variance, select(is_1, tt.variance, r.variance))
    turn = select(is_2, trt.azimuth, select(is_1, tt.azimuth, r.azimuth))
    turn = turn + _sample_azimuth(left, hair.spread)
    turn = select(is_3, _TWO_PI * left, turn)

    # around the mirrored direction along the fibre, by von Mises and Fisher's distribution
    away = 1.0 + v * log(numbers.x + (1.0 - numbers.x) * exp(-2.0 / v))
    away = maximum(minimum(away, 1.0), -1.0)
    _, around = sincos(_TWO_PI * numbers.y)
    sin_i = _other_leg(away) * around * cosine - away * sine
    cos_i = _other_leg(sin_i)
    across_y, across_x = sincos(arctan2(wo.z, wo.x) + turn)
    wi = normalize(vec3(cos_i * across_x, sin_i, cos_i * across_y))
    f_cos, pdf = _eval_pdf(hair, lobes, wo, wi)
    return coated_sample(wi, f_cos, pdf)


@kernel
def albedo(hair, wo):
    """Return pi f |cos| at normal incidence, Mitsuba's default for BSDFs."""
    none = splat_f32(0.0)
    f_cos, _ = eval_pdf(hair, wo, vec3(none, none, none + 1.0))
    return _PI * f_cos


HAIR = BsdfKind(
    "hair",
    Hair,
    read,
    "hair or fur: light that passes a fibre",
    sample,
    eval_pdf,
    albedo=albedo,
    transmits=True,
    oriented=True,
)
