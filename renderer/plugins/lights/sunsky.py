"""Sun and sky: radiance by direction from the model of `sky_model`. Mitsuba's `sunsky`.

The sun is sampled uniformly in a cone. The sky is sampled from a mixture of two pdfs over
the cosine c to the zenith and the azimuth: a normal distribution around the sun's azimuth,
truncated at the horizon and on the opposite side, and one that favours the horizon. If
sampling uses visibility by position (`sky_by_place`), the sky is sampled instead from a
piecewise map of nearly the same pdf.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    splat_mask,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.mathematics import (
    arccos,
    arctan2,
    erfinv,
    exp,
    power,
    sincos,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import (
    column,
    column3,
    dot,
    orthonormal_basis,
    select3,
    vec3,
)
from renderer.plugins.lights.environment import (
    distant_sample,
    environment_light,
    read_rotation,
    rotated,
)
from renderer.plugins.lights.kind import LightPlugin, SphereAround, sample_light
from renderer.plugins.lights.light_tree import LightBounds, from_everywhere
from renderer.plugins.lights.sky_by_place import (
    NOWHERE,
    Cells,
    Floats,
    SkyByPlace,
    density_by_place,
    in_world,
    sample_by_place,
    sky_by_place,
    sky_share_at,
)
from renderer.plugins.lights.sky_model import (
    SkyWarp,
    half_cosine,
    make_sky,
    sky_warp,
)
from renderer.plugins.lights.sun_position import read_sun_direction
from renderer.plugins.sampling.hierarchical_warp import Warp, make_warp
from renderer.plugins.sampling.numbers_and_warps import TWO_PI, square_to_disk
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import SunSky

_HALF_PI = np.float32(0.5 * np.pi)
_ROOT_2 = np.float32(np.sqrt(2.0))
_BY_SOLID_ANGLE = np.float32(1.0 / np.pi**2)  # du dv = pi^2 sin dw, of the upper half
_LEAST = np.float32(2.0**-24)  # smallest probability that is inverted to a normal deviate
_SEGMENTS = 45  # of the sun's elevation, for limb darkening
_LAST = np.int32(_SEGMENTS - 1)
_CHANNEL, _POWER = 24, 6  # rows of `limb` for each channel, and power of the elevation
_MOST_SCALE = 1e20  # with it the radiance of the smallest sun is below 1e30

# -------------------------------------------------------------------------------- reader


def read(properties: Any) -> SunSky:
    """Read the properties of a file."""
    to_world = read_rotation(properties)
    aperture = properties.number("sun_aperture", 0.5358, above=0.0, at_most=179.99)
    if half_cosine(aperture) == 1.0:
        found = f"{aperture:g}, whose solid angle is 0 in single precision"
        properties.fail("sun_aperture", found, "at least 0.028 degrees")
    scales = {"at_least": 0.0, "at_most": _MOST_SCALE}
    light = SunSky(
        read_sun_direction(properties, to_world),
        properties.number("turbidity", 3.0, at_least=1.0, at_most=10.0),
        read_color(properties, "albedo", 0.3, Use.REFLECTANCE),
        properties.number("sun_scale", 1.0, **scales),
        properties.number("sky_scale", 1.0, **scales),
        aperture,
        properties.boolean("complex_sun", False),
        to_world,
    )
    if not make_sky(light).risen:
        properties.reading.warn(
            properties.location,
            f"{properties.element}: the sun is below the horizon, so that it and the sky "
            "give no light; z is up unless to_world turns it",
        )
    return light


# --------------------------------------------------------------------------------- table


class SunSkies(NamedTuple):
    """The environment; at most one. Directions are local: z is up."""

    # (30, 1) nine coefficients of the formula and its factor, by channel
    coefficients: NDArray[np.float32]
    sun: NDArray[np.float32]  # (3, 1) unit, towards its centre
    disk: NDArray[np.float32]  # (3, 1) radiance of a sun without limb darkening
    # (72, 45) coefficients of a sun with limb darkening, by channel, power of the elevation
    # and power of the cosine on the sun; columns by segment of the elevation
    limb: NDArray[np.float32]
    has_limb: int
    cosine: float  # of the sun's angular radius; then 1 minus it
    height: float
    inverse_sine2: float  # 1 / squared sine of the sun's angular radius
    share: float  # probability of sampling the sky and not the sun
    sky_density: float  # the same in all pdfs; 0 if the sun is below the horizon
    sun_density: float  # [1/sr] pdf of samples of the sun; 0 likewise
    lobes: SkyWarp
    # (u, v) of the upper half: azimuth / 2 pi, angle to the zenith / (pi / 2); nearly the
    # pdf of `lobes`, for samples by position
    warp: Warp
    places: SkyByPlace  # visibility of the sky by position
    to_world: NDArray[np.float32]  # (3, 3) a rotation
    to_local: NDArray[np.float32]  # (3, 3) its inverse; files round their rotations
    around: SphereAround

    def directions(self, u: Floats, v: Floats) -> Floats:
        """Return the world space directions (3, n) of points of the warp's square."""
        azimuth, angle = 2.0 * np.pi * u, 0.5 * np.pi * v
        across = np.sin(angle)
        local = across * np.cos(azimuth), across * np.sin(azimuth), np.cos(angle)
        return in_world(self.to_world, local)

    @property
    def sun_direction(self) -> Floats | None:
        """Direction to the sun, (3, 1) world; None if the sun emits nothing."""
        shines = self.sun_density > 0.0 and self.share < 1.0
        return in_world(self.to_world, self.sun.astype(np.float64)) if shines else None

    def with_places(self, cells: Cells, seen: Floats, sun: Floats) -> SunSkies:
        """Return a copy with the given visibility by position (`sky_by_place`)."""
        return self._replace(places=sky_by_place(self.warp, cells, seen, sun, self.share))


def table(count: int, lights: dict[int, SunSky], around: SphereAround) -> SunSkies:
    """Return the environment as the kernels see it."""
    (light,) = lights.values()
    sky = make_sky(light)
    rows = np.concatenate([sky.parameters, sky.radiance[None]]).reshape(-1, 1)
    height = 1.0 - sky.cosine
    rotation = light.to_world[:3, :3]
    lobes = sky_warp(sky.warp, math.atan2(sky.sun[1], sky.sun[0]))
    return SunSkies(
        np.ascontiguousarray(rows, np.float32),
        np.ascontiguousarray(sky.sun[:, None], np.float32),
        np.ascontiguousarray(sky.disk[:, None], np.float32),
        np.ascontiguousarray(sky.limb.reshape(_SEGMENTS, -1).T, np.float32),
        int(light.complex_sun),
        sky.cosine,
        height,
        1.0 / math.sin(math.radians(0.5 * light.sun_aperture)) ** 2,
        sky.share,
        sky.share if sky.risen else 0.0,
        (1.0 - sky.share) / (2.0 * math.pi * height) if sky.risen else 0.0,
        lobes,
        _warp_of(lobes),
        NOWHERE,
        np.ascontiguousarray(rotation, np.float32),
        np.ascontiguousarray(np.linalg.inv(rotation), np.float32),
        around,
    )


def _warp_of(lobes: SkyWarp) -> Warp:
    """Return a piecewise approximation of the pdf of `_in_sky`."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, 33), np.linspace(0.0, 1.0, 65), indexing="ij")
    c = np.cos(0.5 * np.pi * v)
    away = (2.0 * np.pi * u - lobes.azimuth + np.pi) % (2.0 * np.pi) - np.pi
    a, b = (c - lobes.mean) / lobes.spread_c, away / lobes.spread_azimuth
    peak = lobes.peak_density * np.exp(-0.5 * (a * a + b * b))
    density = lobes.rest_density * (1.0 + c * c * lobes.rest_slope) ** -1.5 + peak
    warp = make_warp((density * np.sin(0.5 * np.pi * v)).astype(np.float32))
    assert warp is not None
    return warp


def bounds(light: SunSky) -> LightBounds:
    """Return the bounds: the mean radiance over all directions."""
    return from_everywhere(make_sky(light).mean)


# ------------------------------------------------------------------------------ radiance


@kernel
def _exp3(a):
    return vec3(exp(a.x), exp(a.y), exp(a.z))


@kernel
def _of_sky(sky, c, chord2):
    """Return the radiance of the sky [Hosek2012].

    `c` is the cosine to the zenith, `chord2` the squared distance of the direction's tip
    from the sun's. Near the sun it is more accurate than the cosine of the angle.
    """
    k = sky.coefficients
    chord = sqrt(chord2)
    angle = 2.0 * arctan2(chord, sqrt(maximum(4.0 - chord2, splat_f32(0.0))))
    cos2 = (1.0 - 0.5 * chord2) * (1.0 - 0.5 * chord2)
    horizon = column3(k, 0, 0) * _exp3(column3(k, 3, 0) * (1.0 / (c + 0.01))) + 1.0
    # 1 + h^2 - 2 h cos, for the glow around the sun
    h = column3(k, 24, 0)
    glow = (1.0 - h) * (1.0 - h) + h * chord2
    root = vec3(sqrt(glow.x), sqrt(glow.y), sqrt(glow.z))
    around = column3(k, 6, 0) + column3(k, 9, 0) * _exp3(column3(k, 12, 0) * angle)
    around = around + column3(k, 15, 0) * cos2
    around = around + column3(k, 18, 0) * ((1.0 + cos2) / (glow * root))
    around = around + column3(k, 21, 0) * sqrt(maximum(c, splat_f32(0.0)))
    return horizon * around * column3(k, 27, 0)


@kernel
def _series(limb, row, segment, x, psi, mask):
    """Return a polynomial of the fourth order in x and the sixth in psi."""
    total = splat_f32(0.0)
    for k in range(3, -1, -1):
        inner = splat_f32(0.0)
        for j in range(5, -1, -1):
            inner = inner * psi + gather_row(limb, row + _POWER * k + j, segment, mask)
        total = total * x + inner
    return total


@kernel
def _of_limb(sky, c, chord2, mask):
    """Return the radiance of a sun with limb darkening [Hosek2013].

    Cubics in the elevation, for segments of equal length in its cube root.
    """
    elevation = maximum(_HALF_PI - arccos(c), splat_f32(0.0))
    place = power(elevation * (np.float32(1.0) / _HALF_PI), splat_f32(1.0 / 3.0))
    segment = minimum(to_i32(place * np.float32(_SEGMENTS)), splat_i32(_LAST))
    start = to_f32(segment) * np.float32(1.0 / _SEGMENTS)
    x = elevation - _HALF_PI * start * start * start
    sine2 = chord2 * (1.0 - 0.25 * chord2)
    psi2 = 1.0 - sine2 * np.float32(sky.inverse_sine2)
    psi = sqrt(maximum(psi2, splat_f32(0.0)))
    return vec3(
        _series(sky.limb, 0, segment, x, psi, mask),
        _series(sky.limb, _CHANNEL, segment, x, psi, mask),
        _series(sky.limb, 2 * _CHANNEL, segment, x, psi, mask),
    )


@kernel
def _look_up(sky, position, local, in_sun, mask):
    """Return the radiance from local directions, and the pdf [1/sr] at positions.

    `in_sun` is set for directions sampled in the sun, which rounding may put outside.
    """
    sun, c = column(sky.sun, 0), local.z
    apart = local - sun
    chord2 = dot(apart, apart)
    above = c >= 0.0
    in_sun = above & (in_sun | (dot(local, sun) >= np.float32(sky.cosine)))
    zero = splat_f32(0.0)
    black = vec3(zero, zero, zero)
    disk = black + column(sky.disk, 0)
    if sky.has_limb != 0 and mask_bits(in_sun & mask) != 0:
        disk = _of_limb(sky, c, chord2, in_sun & mask)
    radiance = _of_sky(sky, c, chord2) + select3(in_sun, disk, black)
    sky_density = np.float32(sky.sky_density)
    sun_density = splat_f32(np.float32(sky.sun_density))
    if sky.places.levels == 0:
        density = _sky_density(sky.lobes, local) * sky_density
    else:
        share = sky_share_at(sky.places, position, mask)
        others = np.float32(1.0) - np.float32(sky.share)
        of_sun = (1.0 - share) * np.float32(1.0 / max(others, np.float32(1e-30)))
        sun_density = sun_density * of_sun
        density = _density_by_place(sky, position, local, mask) * share
        density = select(splat_mask(sky_density > 0.0), density, zero)
    density = density + select(in_sun, sun_density, zero)
    return select3(above, radiance, black), select(above, density, zero)


# ------------------------------------------------------------------------------ sampling


@kernel
def _sky_density(warp, local):
    """Return the pdf [1/sr] of `_in_sky`, from its pdf by c and azimuth."""
    c = local.z
    rest = 1.0 + c * c * np.float32(warp.rest_slope)
    rest = np.float32(warp.rest_density) / (rest * sqrt(rest))
    along_x, along_y = np.float32(warp.along_x), np.float32(warp.along_y)
    azimuth = arctan2(
        local.y * along_x - local.x * along_y, local.x * along_x + local.y * along_y
    )
    a = (c - np.float32(warp.mean)) * np.float32(1.0 / warp.spread_c)
    b = azimuth * np.float32(1.0 / warp.spread_azimuth)
    peak = np.float32(warp.peak_density) * exp(-0.5 * (a * a + b * b))
    return rest + peak


@kernel
def _density_by_place(sky, position, local, mask):
    """Return the pdf [1/sr] of `_in_sky_by_place`, above the horizon."""
    azimuth = arctan2(local.y, local.x) * np.float32(1.0 / TWO_PI)
    u = select(azimuth < 0.0, azimuth + 1.0, azimuth)
    v = arccos(local.z) * (np.float32(1.0) / _HALF_PI)
    density = density_by_place(sky.places, sky.warp, position, u, v, mask)
    sine = sqrt(local.x * local.x + local.y * local.y)
    return density * (_BY_SOLID_ANGLE / maximum(sine, splat_f32(_LEAST)))


@kernel
def _in_sky_by_place(sky, position, x, y, mask):
    """Sample a local direction above the horizon, by visibility at a position."""
    u, v, _ = sample_by_place(sky.places, sky.warp, position, x, y, mask)
    sine, c = sincos(v * _HALF_PI)
    across, along = sincos(u * TWO_PI)
    return vec3(sine * along, sine * across, c)


@kernel
def _deviation(x, below, within):
    """Return a normal deviate, truncated to the probabilities [below, below + within]."""
    share = np.float32(below) + x * np.float32(within)
    share = minimum(maximum(share, splat_f32(_LEAST)), splat_f32(np.float32(1.0) - _LEAST))
    return _ROOT_2 * erfinv(2.0 * share - 1.0)


@kernel
def _in_sky(warp, x, y):
    """Sample a local direction above the horizon."""
    peak, slope = splat_f32(np.float32(warp.peak)), np.float32(warp.slope)
    near = x < peak
    c = _deviation(x / peak, warp.below_c, warp.within_c)
    c = c * np.float32(warp.spread_c) + np.float32(warp.mean)
    azimuth = _deviation(y, warp.below_azimuth, warp.within_azimuth)
    azimuth = azimuth * np.float32(warp.spread_azimuth)
    x = (x - peak) / (1.0 - peak)
    far_c = slope * x / sqrt(1.0 + x * x * (slope * slope - np.float32(1.0)))
    c = maximum(select(near, c, far_c), splat_f32(0.0))
    azimuth = select(near, azimuth, (y - 0.5) * TWO_PI)
    sine, cosine = sincos(azimuth + np.float32(warp.azimuth))
    across = sqrt(maximum(1.0 - c * c, splat_f32(0.0)))
    return vec3(across * cosine, across * sine, c)


@kernel
def _in_sun(sky, x, y):
    """Sample a local direction in the sun, uniformly."""
    p, q = square_to_disk(x, y)
    r2 = p * p + q * q
    height = np.float32(sky.height)
    out = sqrt(maximum(height * (2.0 - height * r2), splat_f32(0.0)))
    sun = column(sky.sun, 0)
    n = vec3(splat_f32(sun.x), splat_f32(sun.y), splat_f32(sun.z))
    s, t = orthonormal_basis(n)
    along = np.float32(sky.cosine) + height * (1.0 - r2)
    return s * (p * out) + t * (q * out) + n * along


@sample_light.by(SunSkies)
@kernel
def _sample_sunsky(sky, kind, light, mask, position, x, y, z):
    """Sample either the sky or the sun, and a direction in it."""
    share, by_place = splat_f32(np.float32(sky.share)), sky.places.levels != 0
    if by_place:
        share = sky_share_at(sky.places, position, mask)
    of_sky = x < share
    x = select(of_sky, x / share, (x - share) / (1.0 - share))
    if by_place:
        in_sky = _in_sky_by_place(sky, position, x, y, mask)
    else:
        in_sky = _in_sky(sky.lobes, x, y)
    local = select3(of_sky, in_sky, _in_sun(sky, x, y))
    radiance, pdf = _look_up(sky, position, local, ~of_sky, mask)
    return distant_sample(sky, position, rotated(sky.to_world, local), radiance, pdf)


@environment_light.by(SunSkies)
@kernel
def _sunsky_light(sky, position, direction, mask):
    """Return radiance and pdf of directions; the sun's edge is exactly that of Mitsuba."""
    local = rotated(sky.to_local, direction)
    # the order of the sum is Mitsuba's: the sun is 180 roundings of a cosine wide
    scale = 1.0 / sqrt((local.x * local.x + local.z * local.z) + local.y * local.y)
    return _look_up(sky, position, local * scale, splat_mask(False), mask)


SUNSKY = LightPlugin(
    "sunsky", SunSky, read, table, bounds, at_infinity=True, environment=True
)
