"""Sine, cosine, arc tangent and arc cosine of sixteen float32 at once.

Range reductions and polynomials are those of Cephes' single-precision functions
[Moshier1989], arranged without branches. Calling the C library for each lane would undo
the gain of the lanes, and its last digit changes from machine to machine; here only
additions, multiplications, divisions and square roots occur, each rounded to nearest and
none fused, so every processor computes the same bits.

The errors below were measured against NumPy in float64; an ulp is the spacing of float32
at the true result.
"""

from __future__ import annotations

import math

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    floor,
    maximum,
    minimum,
    select,
    sqrt,
    to_i32,
)

_SIGN_BIT = -0x80000000
_TWO_OVER_PI = 2 / math.pi

# pi/2 in four parts: the first three have at most 11 bits, so their products with a whole
# number below 2^13 are exact in float32 (Cody and Waite's reduction)
_HALF_PI_1 = 1.5703125
_HALF_PI_2 = 4.837512969970703125e-4
_HALF_PI_3 = 7.549533620476723e-8
_HALF_PI_4 = 2.563344151594519e-12

# pi and pi/2 as the nearest float32 and what is left over: a constant of one float32 alone
# would cost a third of an ulp
_PI = 3.1415927410125732
_PI_REST = math.pi - _PI
_HALF_PI = 1.5707963705062866
_HALF_PI_REST = math.pi / 2 - _HALF_PI
_QUARTER_PI = _HALF_PI / 2
_QUARTER_PI_REST = _HALF_PI_REST / 2
_TAN_EIGHTH_PI = math.sqrt(2) - 1


@kernel
def sincos(x):
    """Return (sin x, cos x) of f32x16 angles in radians.

    Sine is exactly odd and cosine exactly even. Error at most 1.6 ulp for
    |x| <= 2 pi; the absolute error stays below 1e-7 for |x| <= 8000 and grows beyond.
    NaN and infinite angles give NaN.
    """
    magnitude = fabs(x)
    turns = floor(magnitude * _TWO_OVER_PI + 0.5)  # quarter turns
    r = magnitude - turns * _HALF_PI_1 - turns * _HALF_PI_2
    r = r - turns * _HALF_PI_3 - turns * _HALF_PI_4
    z = r * r
    sine = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * r + r
    cosine = (2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2
    cosine = cosine * z * z - 0.5 * z + 1.0

    quarter = to_i32(turns)
    odd = (quarter & 1) != 0
    sine_flip = ((quarter & 2) << 30) ^ (as_i32(x) & _SIGN_BIT)
    cosine_flip = ((quarter + 1) & 2) << 30
    return (
        as_f32(as_i32(select(odd, cosine, sine)) ^ sine_flip),
        as_f32(as_i32(select(odd, sine, cosine)) ^ cosine_flip),
    )


@kernel
def arctan2(y, x):
    """Return the angle of the point (x, y) in [-pi, pi], in radians; all f32x16.

    Quadrants, signed zeros and infinities as C's atan2, so (0, 0) gives +-0 or +-pi.
    Error at most 2.3 ulp. NaN gives NaN.
    """
    across = fabs(x)
    up = fabs(y)
    steep = up > across
    a = select(steep, across, up)  # a <= b: an angle of at most pi/4
    b = select(steep, up, across)

    # atan(a/b) = pi/4 + atan((a - b) / (a + b)) keeps the polynomial below pi/8
    wide = (a > _TAN_EIGHTH_PI * b) | ((a == b) & (b > 0.0))
    same = a == b  # also both zero and both infinite, whose ratio is NaN
    t = select(same, 0.0, select(wide, a - b, a)) / select(
        same, 1.0, select(wide, a + b, b)
    )
    z = t * t
    angle = ((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z
    angle = (angle - 3.33329491539e-1) * z * t + t
    angle = select(wide, _QUARTER_PI + (angle + _QUARTER_PI_REST), angle)

    angle = select(steep, _HALF_PI - (angle - _HALF_PI_REST), angle)
    angle = select(as_i32(x) < 0, _PI - (angle - _PI_REST), angle)
    return as_f32(as_i32(angle) | (as_i32(y) & _SIGN_BIT))


@kernel
def arccos(x):
    """Return the arc cosine in [0, pi] of f32x16 clamped to [-1, 1].

    Error at most 1.2 ulp. NaN gives NaN.
    """
    x = maximum(-1.0, minimum(1.0, x))  # the second operand wins: NaN stays
    magnitude = fabs(x)
    # near 1, acos(x) = 2 asin(sqrt((1 - x) / 2)) loses no digits
    steep = magnitude > 0.5
    half = 0.5 * (1.0 - magnitude)
    r = select(steep, sqrt(half), magnitude)
    z = select(steep, half, magnitude * magnitude)
    arcsine = ((4.2163199048e-2 * z + 2.4181311049e-2) * z + 4.5470025998e-2) * z
    arcsine = ((arcsine + 7.4953002686e-2) * z + 1.6666752422e-1) * z * r + r

    near_end = select(x < 0.0, _PI - (2.0 * arcsine - _PI_REST), 2.0 * arcsine)
    signed = select(x < 0.0, -arcsine, arcsine)
    return select(steep, near_end, _HALF_PI - (signed - _HALF_PI_REST))
