"""Elementary functions of 16 float32 lanes."""

from __future__ import annotations

import math
import sys
from typing import Any

from numba.core import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic

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
    to_double,
    to_f32,
    to_i32,
    to_single,
)
from renderer.kernels.lanes.masks import call
from renderer.kernels.lanes.types import Lanes, operands, widen

# -------------------------------------------------------------------------------- fused
# Fused multiply-add, for bounds with a margin for rounding.
#
# A processor with FMA rounds once; one without computes a * b + c with two roundings. So
# results differ in the last bit between processors. A box test with a margin may use it; a
# hit or a colour must not.


@intrinsic
def multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c of float32 lanes; scalar operands are broadcast."""
    lanes = next((x for x in (a, b, c) if isinstance(x, Lanes)), None)
    fits = lanes is not None and all(operands(lanes, x) == lanes for x in (a, b, c))
    if not fits or lanes.element != types.float32:
        raise TypingError(f"multiply_add needs float32 lanes, not {a}, {b} and {c}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = [
            widen(context, builder, value, of, lanes)
            for value, of in zip(args, sig.args, strict=True)
        ]
        name = f"llvm.fmuladd.v{lanes.width}f32"
        return call(builder, name, values[0].type, *values)

    return signature(lanes, a, b, c), codegen


# ------------------------------------------------------------------------- exponentials
# Exponential, logarithm and power of 16 float32 lanes.
#
# All three are powers of two inside, computed in double precision in two registers of
# eight. The remainder of a range reduction and the error of a short series are then below
# the resolution of float32. A power keeps its digits too: its exponent would multiply the
# error of a single-precision logarithm by up to 128. Only operations that every processor
# rounds in the same way are used.

_LN_2 = math.log(2)
_LOG2_E = 1 / _LN_2
_SMALLEST_NORMAL = 2.0**-126
_BITS_OF_ROOT_HALF = 0x3F3504F3  # bits of sqrt(1/2), the lower end of the mantissa's range

# 2^r = e^(r ln 2) for |r| <= 1/2: the ninth term of the series is below 2^-32
_E0, _E1, _E2, _E3, _E4, _E5, _E6, _E7, _E8 = (
    _LN_2**k / math.factorial(k) for k in range(9)
)
# log2 m = 2 / ln 2 atanh(s), s = (m - 1) / (m + 1); s^2 <= 0.0295, remainder 2^-40
_L0, _L1, _L2, _L3, _L4, _L5, _L6 = (2 / _LN_2 / (2 * k + 1) for k in range(7))


@kernel
def exp2_of_double(t):
    """Return 2^t in single precision for double-precision lanes t.

    Error at most 0.51 ulp; for subnormal results (below 2^-126) one unit in the last place.
    """
    t = maximum(-200.0, minimum(200.0, t))  # the second operand wins, so NaN is kept
    whole = floor(t + 0.5)
    r = t - whole
    power = ((((_E8 * r + _E7) * r + _E6) * r + _E5) * r + _E4) * r
    power = ((((power + _E3) * r + _E2) * r + _E1) * r) + _E0
    # two factors, as float32 cannot represent 2^-140 or 2^128
    n = to_i32(to_single(whole))
    half = n >> 1
    first, second = as_f32((half + 127) << 23), as_f32((n - half + 127) << 23)
    return to_single(power) * first * second


@kernel
def log2_in_double(x):
    """Return log2 x of f32x16 in double precision, relative error 2^-38.

    -inf for 0, NaN for negative numbers and NaN.
    """
    tiny = x < _SMALLEST_NORMAL
    bits = as_i32(select(tiny, x * 2.0**24, x))
    exponent = (bits - _BITS_OF_ROOT_HALF) >> 23
    mantissa = to_double(as_f32(bits - (exponent << 23)))  # in [sqrt(1/2), sqrt(2))
    s = (mantissa - 1.0) / (mantissa + 1.0)
    z = s * s
    series = (((((_L6 * z + _L5) * z + _L4) * z + _L3) * z + _L2) * z + _L1) * z + _L0
    whole = to_double(to_f32(exponent - select(tiny, 24, exponent * 0)))
    logarithm = s * series + whole
    wide = to_double(x)  # 0, infinity, negative numbers and NaN
    logarithm = select(x == math.inf, wide, logarithm)
    no_number = select(x == 0.0, wide - math.inf, wide * math.nan)
    return select(x > 0.0, logarithm, no_number)


@kernel
def exp(x):
    """Return e^x of f32x16; error as for `exp2_of_double`."""
    return exp2_of_double(to_double(x) * _LOG2_E)


@kernel
def log(x):
    """Return the natural logarithm of f32x16; error at most 0.51 ulp."""
    return to_single(log2_in_double(x) * _LN_2)


@kernel
def power(x, y):
    """Return x^y of f32x16 for x >= 0; error as for `exp2_of_double`.

    As C's powf, except that negative x give NaN. x^0 is 1 for every x.
    """
    result = exp2_of_double(to_double(y) * log2_in_double(x))
    return select((y == 0.0) | (x == 1.0), 1.0, result)


# ----------------------------------------------------------------------- error function
# The error function and its inverse, of 16 float32 lanes.
#
# The polynomials were fitted for this file to SciPy's functions in double precision, by
# least squares reweighted towards equal errors. They are evaluated in double precision,
# since terms of both signs cancel near the ends of the range.

_SIGN_BIT = -0x80000000
_MINUS_LN_2 = -math.log(2)
_STEEP = 5.0  # -log(1 - x^2) above which the tail's polynomial is used


@kernel
def erf(x):
    """Return 2 / sqrt(pi) times the integral of exp(-t^2) from 0 to x, of f32x16.

    Error at most 0.6 ulp. NaN gives NaN.
    """
    a = to_double(minimum(4.0, fabs(x)))  # erf is 1 in single precision above 4
    z = a * a
    # erf a = a P(a^2) up to 1, error 8e-11
    p = (-9.6415145330e-6 * z + 1.1256947334e-4) * z - 8.4828287608e-4
    p = ((p * z + 5.2209454266e-3) * z - 2.6865400040e-2) * z + 1.1283781974e-1
    p = (p * z - 3.7612638435e-1) * z + 1.1283791671
    # erf a = 1 - 2^-Q(a) from 1 to 4, error 3e-11
    q = (3.1303219523e-5 * a - 6.3691253916e-4) * a + 6.0669540887e-3
    q = ((q * a - 3.6370860853e-2) * a + 1.5642007084e-1) * a + 9.1353811334e-1
    q = (q * a + 1.6296399349) * a - 2.7190609741e-4
    result = select(a < 1.0, to_single(a * p), 1.0 - exp2_of_double(-q))
    return as_f32(as_i32(result) | (as_i32(x) & _SIGN_BIT))


@kernel
def erfinv(x):
    """Return the inverse error function of f32x16 x in [-1, 1].

    By polynomials in w = -log(1 - x^2) [Giles2011], with coefficients fitted here. Error at
    most 1 ulp. -1 and 1 give infinities, numbers outside [-1, 1] give NaN.
    """
    # 1 - x and 1 + x lose no digits near the ends, where w is steep
    w = log2_in_double((1.0 - x) * (1.0 + x)) * _MINUS_LN_2
    # |x| < 0.9966, error 2e-9
    p = (3.3556381580e-10 * w - 1.7161881396e-8) * w + 3.0980186748e-7
    p = ((p * w - 2.4979046007e-6) * w + 5.8356910822e-6) * w + 4.0486688200e-5
    p = ((p * w - 1.2200252833e-4) * w - 2.3385406556e-3) * w + 1.1550335549e-2
    p = (p * w + 2.3201355600e-1) * w + 8.8622692745e-1
    # up to the last float32 below 1, w = 15.9, error 1.3e-8
    s = sqrt(w)
    q = (1.1010031560e-4 * s - 3.2770735197e-3) * s + 4.2928586211e-2
    q = ((q * s - 3.2390664589e-1) * s + 1.5444665318) * s - 4.7914699526
    q = ((q * s + 9.5473755802) * s - 1.1478315403e1) * s + 8.0879152039
    q = q * s - 1.5244702479
    result = to_single(to_double(x) * select(w < _STEEP, p, q))
    return select(fabs(x) == 1.0, x * math.inf, result)


# -------------------------------------------------------------------------- mathematics
# Sine, cosine, arc tangent and arc cosine of 16 float32 lanes.
#
# Range reductions and polynomials are those of Cephes' single-precision functions
# [Moshier1989], without branches. Calls of the C library per lane would be slow, and its
# last digit differs between machines. Here only additions, multiplications, divisions and
# square roots occur, each rounded to nearest and none fused, so every processor computes
# the same bits.
#
# The errors below were measured against NumPy in float64; an ulp is the spacing of
# float32 at the true result.

_TWO_OVER_PI = 2 / math.pi

# pi/2 in four parts. The first three have at most 11 bits, so their products with an
# integer below 2^13 are exact in float32 (Cody and Waite's reduction).
_HALF_PI_1 = 1.5703125
_HALF_PI_2 = 4.837512969970703125e-4
_HALF_PI_3 = 7.549533620476723e-8
_HALF_PI_4 = 2.563344151594519e-12

# pi and pi/2 as the nearest float32 plus a remainder: one float32 alone would cost a third
# of an ulp
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

    Sine is exactly odd and cosine exactly even. The error is at most 1.6 ulp for
    |x| <= 2 pi. The absolute error is below 1e-7 for |x| <= 8000 and grows beyond. NaN and
    infinite angles give NaN.
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
    x = maximum(-1.0, minimum(1.0, x))  # the second operand wins, so NaN is kept
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


# ------------------------------------------- former names, for one version

# Users' BSDFs import from these modules, as earlier messages told them to.
for _name in ("mathematics", "exponentials", "error_function"):
    sys.modules[f"{__name__}.{_name}"] = sys.modules[__name__]
