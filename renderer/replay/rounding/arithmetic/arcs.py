"""Mitsuba's arc tangent and arc cosine: Cephes' polynomials, summed by pairs and fused."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.replay.rounding.arithmetic.fused_lanes import fused

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
