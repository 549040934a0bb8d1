"""Environment maps in a replay: Mitsuba's way from directions to texels and back.

Its arc tangent is off by up to 6e-7, its place in the image is rounded three times, and a
number that chose one texel among 10^5 has few digits left: where a map is steep, light
differs by 1e-4. With the same operations, fused as in its wheels, (u, v) of 20000 of 20000
samples agreed in all bits. As everywhere in a replay, no more than rounding is replaced.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel, kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import column, gather3, select3, vec3
from renderer.kinds.lights.environment import environment_light
from renderer.kinds.lights.envmap import (
    BY_SOLID_ANGLE,
    INV_TWO_PI,
    SMALLEST_SINE,
    EnvironmentMaps,
    half_texel,
    importance,
    latitudes,
    sample_envmap,
)
from renderer.kinds.lights.kind import LightSample, sample_light
from renderer.kinds.sampling.hierarchical_warp import (
    FLAT,
    Warp,
    choose_patch,
    corners,
    make_warp,
)
from renderer.kinds.sampling.numbers_and_warps import INV_PI, TWO_PI
from renderer.replay.rounding.directions import sincos_as_mitsuba
from renderer.replay.rounding.fused_lanes import fused
from renderer.replay.rounding.texture_means import rounded_luminance
from renderer.scene_file.description import EnvironmentMap

Floats = NDArray[np.float32]

_TURNED = np.float32(1e-3)  # directions farther apart are not one direction, rounded
_CHANGED = np.float32(1e-2)  # the same of light and densities, relative: steep maps do 3e-3
_SIGN_BIT = -0x80000000
_PI = np.float32(np.pi)
_HALF_PI = np.float32(0.5 * np.pi)
_ARC_TANGENT = tuple(
    np.float32(c)
    for c in (
        *(0.99999934166683966009, -0.33326497518773606976, 0.19881342388439013552),
        *(-0.13486708938456973185, 0.083863120428809689910, -0.037006525670417265220),
        0.0078613793713198150252,
    )
)
_ARC_SINE = tuple(
    np.float32(c)
    for c in (
        *(1.666675242e-1, 7.4953002686e-2, 4.5470025998e-2, 2.4181311049e-2),
        4.2163199048e-2,
    )
)


class RoundedEnvironment(NamedTuple):
    """An environment map with both ways to round."""

    own: EnvironmentMaps
    warp: Warp  # of luminances and sines with Mitsuba's roundings
    to_local: Floats  # (3, 3) the inverse; a rotation in a file is one to a few digits only


def rounded_environment(own: EnvironmentMaps, sky: EnvironmentMap) -> RoundedEnvironment:
    """Return what a replay needs of an environment map beside the renderer's own table."""
    luminance = rounded_luminance(*np.moveaxis(sky.pixels, -1, 0))
    sine = _sines(latitudes(len(sky.pixels)))
    warp = make_warp(importance(luminance, sine, compensated=sky.mis_compensation))
    to_local = np.linalg.inv(sky.to_world[:3, :3]).astype(np.float32)
    return RoundedEnvironment(own, own.warp if warp is None else warp, to_local)


def _sines(angle: Floats) -> Floats:
    padded = np.pad(angle, (0, -len(angle) % 16))
    _fill_sines(padded, padded)
    return padded[: len(angle)]


@entry_kernel
def _fill_sines(angle, sine):
    for i in range(0, angle.size, 16):
        value, _ = sincos_as_mitsuba(load_row(angle, 0, i))
        store_row(sine, 0, i, value)


@kernel
def _between(a, b, t):
    return fused(b, t, fused(-a, t, a))


@kernel
def _linear(a, b, x):
    """Return where x of the area below a line from a to b lies to the left."""
    steep = fabs(a - b) > FLAT * (a + b)
    below = sqrt(maximum(_between(a * a, b * b, x), splat_f32(0.0)))
    slope = select(steep, a - b, splat_f32(1.0))
    return select(steep, (a - below) / slope, x)


@kernel
def _sample_warp(warp, x, y, mask):
    column, row, x, y = choose_patch(warp, x, y, mask)
    v00, v10, v01, v11 = corners(warp, column, row, mask)
    y = _linear(v00 + v10, v01 + v11, y)
    left, right = _between(v00, v01, y), _between(v10, v11, y)
    x = _linear(left, right, x)
    u = (to_f32(column) + x) * np.float32(1.0 / warp.columns)
    v = (to_f32(row) + y) * np.float32(1.0 / warp.rows)
    return u, v, _between(left, right, x)


@kernel
def _warp_density(warp, u, v, mask):
    x, y = u * np.float32(warp.columns), v * np.float32(warp.rows)
    column = minimum(to_i32(x), splat_i32(np.int32(warp.columns - 1)))
    row = minimum(to_i32(y), splat_i32(np.int32(warp.rows - 1)))
    v00, v10, v01, v11 = corners(warp, column, row, mask)
    x, y = x - to_f32(column), y - to_f32(row)
    return _between(_between(v00, v10, x), _between(v01, v11, x), y)


@kernel
def arctan2_as_mitsuba(y, x):
    """Return the angle of (x, y) in [-pi, pi], off by 6e-7 at most as Mitsuba's."""
    across, up = fabs(x), fabs(y)
    larger = maximum(across, up)
    ratio = minimum(across, up) / select(larger > 0.0, larger, splat_f32(1.0))
    z = ratio * ratio
    z2 = z * z
    c = _ARC_TANGENT
    low = fused(z2, fused(z, c[3], splat_f32(c[2])), fused(z, c[1], splat_f32(c[0])))
    high = fused(z2, c[6], fused(z, c[5], splat_f32(c[4])))
    t = fused(z2 * z2, high, low) * ratio
    t = select(up > across, _HALF_PI - t, t)
    t = select(x < 0.0, _PI - t, t)
    return select(y < 0.0, -t, t)


@kernel
def arccos_as_mitsuba(x):
    """Return the arc cosine in [0, pi] of lanes clamped to [-1, 1]."""
    x = minimum(maximum(x, splat_f32(-1.0)), splat_f32(1.0))
    magnitude = fabs(x)
    steep = magnitude > 0.5
    half = 0.5 * (1.0 - magnitude)
    z = select(steep, half, x * x)
    r = select(steep, sqrt(half), magnitude)
    z2 = z * z
    c = _ARC_SINE
    low = fused(z2, fused(z, c[3], splat_f32(c[2])), fused(z, c[1], splat_f32(c[0])))
    arc = fused(fused(z2 * z2, c[4], low), z * r, r)
    twice = arc + arc
    signed = as_f32(as_i32(arc) | (as_i32(x) & _SIGN_BIT))
    return select(steep, select(x < 0.0, _PI - twice, twice), _HALF_PI - signed)


@kernel
def _radiance(sky, u, v, mask):
    """Return the radiance at points of the image: of W + 2 columns, for Mitsuba."""
    across, down = np.float32(sky.width + 2), np.float32(sky.height)
    v = minimum(maximum(v, splat_f32(0.0)), splat_f32(1.0))
    x = fused(u - floor(u), np.float32(sky.width), splat_f32(1.0)) / across
    y = fused(v, np.float32(sky.height - 1), splat_f32(0.5)) / down
    x, y = fused(x, across, splat_f32(-0.5)), fused(y, down, splat_f32(-0.5))
    x, y = maximum(x, splat_f32(0.0)), maximum(y, splat_f32(0.0))
    i = minimum(to_i32(x), splat_i32(np.int32(sky.width)))
    j = minimum(to_i32(y), splat_i32(np.int32(sky.height - 2)))
    a, b = x - to_f32(i), y - to_f32(j)
    first = j * np.int32(sky.width + 2) + i
    below = first + np.int32(sky.width + 2)
    upper = gather3(sky.texels, first, mask) * (1.0 - a)
    upper = upper + gather3(sky.texels, first + 1, mask) * a
    lower = gather3(sky.texels, below, mask) * (1.0 - a)
    lower = lower + gather3(sky.texels, below + 1, mask) * a
    return (upper * (1.0 - b) + lower * b) * np.float32(sky.scale)


@kernel
def _times(matrix, d):
    a, b, c = column(matrix, 0), column(matrix, 1), column(matrix, 2)
    return vec3(
        fused(c.x, d.z, fused(b.x, d.y, a.x * d.x)),
        fused(c.y, d.z, fused(b.y, d.y, a.y * d.x)),
        fused(c.z, d.z, fused(b.z, d.y, a.z * d.x)),
    )


@kernel
def _largest(a):
    return maximum(fabs(a.x), maximum(fabs(a.y), fabs(a.z)))


@kernel
def _rounded(own, other):
    """Return where light is the same but for rounding."""
    return _largest(own - other) <= _CHANGED * _largest(own)


@sample_light.by(RoundedEnvironment)
@kernel
def _sample(sky, kind, light, mask, position, x, y, z):
    own = sample_envmap(sky.own, kind, light, mask, position, x, y, z)
    u, v, density = _sample_warp(sky.warp, x, y, mask)
    u = u + half_texel(sky.own)
    sine, cosine = sincos_as_mitsuba(v * _PI)
    across, along = sincos_as_mitsuba(u * TWO_PI)
    wi = _times(sky.own.to_world, vec3(across * sine, cosine, -(along * sine)))
    pdf = density * (1.0 / maximum(sine, splat_f32(SMALLEST_SINE))) * BY_SOLID_ANGLE
    usable = pdf > 0.0
    radiance = _radiance(sky.own, u, v, mask) / select(usable, pdf, splat_f32(1.0))
    same = usable & (_largest(own.wi - wi) <= _TURNED)
    same = same & (fabs(own.pdf - pdf) <= _CHANGED * own.pdf)
    same = same & _rounded(own.radiance, radiance)
    return LightSample(
        select3(same, wi, own.wi),
        own.distance,
        select3(same, radiance, own.radiance),
        select(same, pdf, own.pdf),
    )


@environment_light.by(RoundedEnvironment)
@kernel
def _light(sky, direction, mask):
    own, own_density = environment_light(sky.own, direction, mask)
    local = _times(sky.to_local, direction)
    u = arctan2_as_mitsuba(local.x, -local.z) * INV_TWO_PI
    v = arccos_as_mitsuba(local.y) * INV_PI
    radiance = _radiance(sky.own, u, v, mask)
    shifted = u - half_texel(sky.own)
    density = _warp_density(sky.warp, shifted - floor(shifted), v, mask)
    sine = maximum(sqrt(local.x * local.x + local.z * local.z), splat_f32(SMALLEST_SINE))
    density = density * (1.0 / sine) * BY_SOLID_ANGLE
    same = _rounded(own, radiance)
    near = fabs(own_density - density) <= _CHANGED * own_density
    return select3(same, radiance, own), select(near, density, own_density)
