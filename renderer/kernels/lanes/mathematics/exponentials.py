"""Exponential, logarithm and power of sixteen float32 at once.

All three are powers of two inside, and these are computed in double precision, two
registers of eight: the rest of a range reduction and the error of a short series then stay
below what float32 can show, and a power keeps its digits, whose exponent would multiply
the error of a single-precision logarithm by up to 128. Only operations that are rounded
alike on every processor occur, as in `renderer.kernels.lanes.mathematics.mathematics`.
"""

from __future__ import annotations

import math

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    floor,
    maximum,
    minimum,
    select,
    to_double,
    to_f32,
    to_i32,
    to_single,
)

_LN_2 = math.log(2)
_LOG2_E = 1 / _LN_2
_SMALLEST_NORMAL = 2.0**-126
_BITS_OF_ROOT_HALF = 0x3F3504F3  # of sqrt(1/2), where the mantissa's range begins

# 2^r = e^(r ln 2) for |r| <= 1/2: the ninth term of the series is below 2^-32
_E0, _E1, _E2, _E3, _E4, _E5, _E6, _E7, _E8 = (
    _LN_2**k / math.factorial(k) for k in range(9)
)
# log2 m = 2 / ln 2 atanh(s), s = (m - 1) / (m + 1); s^2 <= 0.0295, so the rest is 2^-40
_L0, _L1, _L2, _L3, _L4, _L5, _L6 = (2 / _LN_2 / (2 * k + 1) for k in range(7))


@kernel
def exp2_of_double(t):
    """Return 2^t in single precision for lanes t in double precision.

    Error at most 0.51 ulp; below 2^-126, where digits are few, one unit of the last.
    """
    t = maximum(-200.0, minimum(200.0, t))  # the second operand wins: NaN stays
    whole = floor(t + 0.5)
    r = t - whole
    power = ((((_E8 * r + _E7) * r + _E6) * r + _E5) * r + _E4) * r
    power = ((((power + _E3) * r + _E2) * r + _E1) * r) + _E0
    # in two steps, as neither 2^-140 nor 2^128 has a float32 of its own
    n = to_i32(to_single(whole))
    half = n >> 1
    first, second = as_f32((half + 127) << 23), as_f32((n - half + 127) << 23)
    return to_single(power) * first * second


@kernel
def log2_in_double(x):
    """Return log2 x of f32x16 in double precision, to 2^-38 of it.

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
    wide = to_double(x)  # the infinities of both ends, and what has no logarithm
    logarithm = select(x == math.inf, wide, logarithm)
    no_number = select(x == 0.0, wide - math.inf, wide * math.nan)
    return select(x > 0.0, logarithm, no_number)


@kernel
def exp(x):
    """Return e^x of f32x16; error as `exp2_of_double`."""
    return exp2_of_double(to_double(x) * _LOG2_E)


@kernel
def log(x):
    """Return the natural logarithm of f32x16; error at most 0.51 ulp."""
    return to_single(log2_in_double(x) * _LN_2)


@kernel
def power(x, y):
    """Return x^y of f32x16 for x >= 0; error as `exp2_of_double`.

    As C's powf, but negative x give NaN; x^0 is 1 for every x.
    """
    result = exp2_of_double(to_double(y) * log2_in_double(x))
    return select((y == 0.0) | (x == 1.0), 1.0, result)
