"""Sky and sun model of Hosek and Wilkie: coefficients for one sky, in NumPy.

The models of the sky [Hosek2012] and of the sun [Hosek2013] are tables fitted to a
simulation of the atmosphere: nine coefficients of a formula and a radiance, by turbidity,
ground albedo and elevation of the sun. `sunsky.npz` has the part that Mitsuba's `sunsky`
uses, in RGB and in single precision; docs/make_sunsky_tables.py created it.

Directions are local: z is up. What does not depend on the direction is computed here, in
double precision except where Mitsuba's rounding affects the result.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import SunSky

Array = NDArray[np.float64]

APERTURE = 0.5358  # [deg] of the real sun, on which the tables are based
# Integral of CIE Y over wavelength [nm], by which Mitsuba divides; and the factor from a
# mean over the bands of the sun's spectrum to RGB.
_Y = 106.7502593994140625
_SUN_TO_RGB = 467.069280386
_BINOMIALS = np.array([1, 5, 10, 10, 5, 1])  # of a Bezier curve with six control points
_BELOW_ONE = 1.0 - 2.0**-24
# DrJit's cosine up to 45 degrees: 1 - x^2 / 2 + x^4 (these coefficients)
_COSINE = (4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5)
# The cosine of a right angle in single precision: a lower sun emits nothing in Mitsuba.
_HORIZON = 4.4e-8


class Sky(NamedTuple):
    """Coefficients in the local frame; all radiances are 0 for a sun below the horizon."""

    sun: Array  # (3,) unit, towards its centre
    risen: bool
    parameters: Array  # (9, 3) coefficients of the formula, by channel
    radiance: Array  # (3,) factor of the formula
    disk: Array  # (3,) radiance of a sun without limb darkening
    limb: Array  # (45, 3, 4, 6) coefficients of a sun with it, by segment of elevation
    cosine: float  # cosine of the sun's angular radius, a float32
    share: float  # probability of sampling the sky and not the sun, a float32
    warp: Array  # (5,) probability of the peak, slope of the rest; mean, deviations
    mean: float  # mean radiance over all directions, sun included


@functools.cache
def tables() -> dict[str, Array]:
    """Return the tables by name; the first axis is the turbidity, from 1 to 10.

    sky_parameters (10, 2 albedos, 6 points of a curve over elevation, 3 channels, 9),
    sky_radiance (10, 2, 6, 3), sun_radiance (10, 45 segments, 3, 4 powers of the elevation,
    6 of the cosine to the sun's surface), and by 30 elevations: sky_power and sun_power
    (10, 30), luminance over all directions; sun_rgb (10, 30, 3), irradiance; warp
    (10, 30, 5). Mitsuba looks up the last one as from 2 to 88 degrees in equal steps, and
    the others in steps of 3 degrees from 2 on.
    """
    with np.load(Path(__file__).with_name("sunsky.npz")) as file:
        return {name: file[name].astype(np.float64) for name in file.files}


def between(table: Array, place: float) -> Array:
    """Return a table's entry at `place` on its first axis, interpolated linearly."""
    place = min(max(place, 0.0), len(table) - 1.0)
    low = min(int(place), len(table) - 2)
    return np.asarray(table[low] + (table[low + 1] - table[low]) * (place - low))


def make_sky(light: SunSky) -> Sky:
    """Return the coefficients of a sky."""
    sun = np.linalg.inv(light.to_world[:3, :3]) @ np.array(light.sun_direction)
    sun /= np.linalg.norm(sun)
    elevation = math.atan2(sun[2], math.hypot(sun[0], sun[1]))
    risen = bool(sun[2] > _HORIZON)
    t = light.turbidity - 1.0
    of_turbidity = {name: between(table, t) for name, table in tables().items()}

    x = min(np.cbrt(max(2.0 / math.pi * elevation, 0.0)), _BELOW_ONE)
    powers = np.arange(6)
    curve = _BINOMIALS * x**powers * (1.0 - x) ** (5 - powers)

    def at_elevation(name: str) -> Array:
        dark, bright = of_turbidity[name]
        albedo = np.reshape(light.albedo, (3, *(1,) * (dark.ndim - 2)))
        return np.tensordot(curve, dark + (bright - dark) * albedo, 1)

    degrees = math.degrees(elevation)
    step, warp_step = (degrees - 2.0) / 3.0, 29.0 * (degrees - 2.0) / 86.0
    sky_power = light.sky_scale * float(between(of_turbidity["sky_power"], step))
    sun_power = light.sun_scale * float(between(of_turbidity["sun_power"], step))
    cosine, real = half_cosine(light.sun_aperture), half_cosine(APERTURE)
    larger = (1.0 - real) / (1.0 - cosine)  # the radiance of a larger sun is smaller
    both = sky_power + sun_power * larger
    sun_scale = light.sun_scale * larger * _SUN_TO_RGB / _Y if risen else 0.0
    sky_scale = light.sky_scale / _Y if risen else 0.0
    irradiance = between(of_turbidity["sun_rgb"], step)
    return Sky(
        sun,
        risen,
        at_elevation("sky_parameters").T,
        at_elevation("sky_radiance") * sky_scale,
        irradiance / (2.0 * math.pi * (1.0 - real)) * sun_scale,
        of_turbidity["sun_radiance"] * sun_scale,
        cosine,
        float(np.float32(sky_power / both)) if both > 0.0 else 0.0,
        between(of_turbidity["warp"], warp_step),
        risen * (sky_power + sun_power) * _SUN_TO_RGB / _Y / (4.0 * math.pi),
    )


def half_cosine(aperture: float) -> float:
    """Return the cosine of half an angle [deg], with Mitsuba's single precision rounding.

    The solid angle 2 pi (1 - cosine) of the real sun has an error of 0.2 %, as in Mitsuba.
    Below 45 degrees the result is not always the nearest float32.
    """
    half = np.float32(0.5) * np.float32(aperture) * np.float32(math.pi / 180.0)
    if half >= np.float32(0.25 * math.pi):
        return float(np.float32(math.cos(float(half))))
    z, k = half * half, np.array(_COSINE, np.float32)
    high = _fused(z * z, k[2], _fused(z, k[1], k[0])) * z
    return float(_fused(high, z, _fused(z, -0.5, 1.0)))


def _fused(a: float, b: float, c: float) -> np.float32:
    """Return a b + c, rounded once (fused multiply-add)."""
    return np.float32(float(a) * float(b) + float(c))


# ------------------------------------------------------------------------------ sampling


class SkyWarp(NamedTuple):
    """Sampling of the sky by c, the cosine to the zenith, and azimuth."""

    peak: float  # share of the normal distribution
    slope: float  # of the rest: c = slope x / sqrt(1 + x^2 (slope^2 - 1))
    mean: float  # of c; that of the azimuth is the sun's
    spread_c: float  # standard deviations
    spread_azimuth: float
    below_c: float  # share of c below 0, and the share in [0, 1]
    within_c: float
    below_azimuth: float  # the same of [-pi, pi]
    within_azimuth: float
    azimuth: float  # of the sun
    along_x: float  # its cosine and sine
    along_y: float
    peak_density: float  # [1/sr] at the mean
    rest_density: float  # [1/sr] at the horizon
    rest_slope: float


def sky_warp(numbers: Array, azimuth: float) -> SkyWarp:
    """Return the sampling parameters, from `Sky.warp` and the sun's azimuth."""
    peak, slope, mean, spread_c, spread_azimuth = map(float, numbers)
    below_c, above_c = (_normal_share((c - mean) / spread_c) for c in (0.0, 1.0))
    below, above = (_normal_share(a / spread_azimuth) for a in (-math.pi, math.pi))
    area = 2.0 * math.pi * spread_c * spread_azimuth * (above_c - below_c) * (above - below)
    return SkyWarp(
        peak,
        slope,
        mean,
        spread_c,
        spread_azimuth,
        below_c,
        above_c - below_c,
        below,
        above - below,
        azimuth,
        math.cos(azimuth),
        math.sin(azimuth),
        peak / area,
        (1.0 - peak) / (2.0 * math.pi * slope),
        1.0 / slope**2 - 1.0,
    )


def _normal_share(x: float) -> float:
    """Return the cumulative standard normal distribution at x."""
    return 0.5 * (1.0 + math.erf(x / math.sqrt(2.0)))
