"""Hair and fur [Chiang2016]: light that passes a fibre in one scattering event.

The fibre runs along y. Its lobes are in `hair_lobes`. The cosine of f |cos| is part of the
model, and the formulas are the same for all signs of z.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import fabs, maximum, minimum, select
from renderer.kernels.lanes.mathematics import arctan2, exp, log, sincos
from renderer.kernels.lanes.vectors import normalize, vec3
from renderer.plugins.bsdfs.dielectric import read_relative_index
from renderer.plugins.bsdfs.hair_lobes import (
    azimuthal,
    lobes_of,
    longitudinal,
    other_leg,
    sample_azimuth,
)
from renderer.plugins.bsdfs.kind import BsdfKind, Color, Float, albedo_at_normal_incidence
from renderer.plugins.bsdfs.roughplastic import coated_sample
from renderer.plugins.sampling.numbers_and_warps import TWO_PI, AlongU, Plain
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import ConstantTexture, OtherBsdf, Texture
from renderer.scene_file.objects.objects import read_texture

# absorption of a unit of pigment, per radius of the hair [DEon2011b]
_EUMELANIN = np.array([0.419, 0.697, 1.37])
_PHEOMELANIN = np.array([0.187, 0.4, 1.05])


class Hair(NamedTuple):
    """Its parameters."""

    variance: Float  # v of lobe R; TT has a quarter of it, the others four times as much
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
    # fits of [Chiang2016]
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


# ------------------------------------------------------------------------------- kernels


@kernel
def _density(hair, lobe, sin_i, turn):
    """Return the density [1/sr] of a lobe at theta of wi and an azimuth from that of wo."""
    around = azimuthal(turn - lobe.azimuth, hair.spread)
    return longitudinal(lobe.sine, sin_i, lobe.variance) * TWO_PI * around


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
    d3 = longitudinal(more.sine, wi.y, more.variance)
    pdf = d0 * r.share + d1 * tt.share + d2 * trt.share + d3 * more.share
    f = r.attenuation * d0 + tt.attenuation * d1 + trt.attenuation * d2
    f = f + more.attenuation * d3
    return vec3(_finite(f.x), _finite(f.y), _finite(f.z)), _finite(pdf)


@kernel
def eval_pdf(hair, wo, wi):
    """Return f |cos| and the pdf [1/sr]."""
    return _eval_pdf(hair, lobes_of(hair, wo), wo, wi)


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
    r, tt, trt, more = lobes = lobes_of(hair, wo)
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
    turn = turn + sample_azimuth(left, hair.spread)
    turn = select(is_3, TWO_PI * left, turn)

    # around the mirrored direction along the fibre, by von Mises and Fisher's distribution
    away = 1.0 + v * log(numbers.x + (1.0 - numbers.x) * exp(-2.0 / v))
    away = maximum(minimum(away, 1.0), -1.0)
    _, around = sincos(TWO_PI * numbers.y)
    sin_i = other_leg(away) * around * cosine - away * sine
    cos_i = other_leg(sin_i)
    across_y, across_x = sincos(arctan2(wo.z, wo.x) + turn)
    wi = normalize(vec3(cos_i * across_x, sin_i, cos_i * across_y))
    f_cos, pdf = _eval_pdf(hair, lobes, wo, wi)
    return coated_sample(wi, f_cos, pdf)


HAIR = BsdfKind(
    "hair",
    Hair,
    read,
    "hair or fur: light that passes a fibre",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
    transmits=True,
    oriented=True,
)
