"""The error function and its inverse, of sixteen float32 at once.

The polynomials were fitted for this file, by least squares that were reweighted towards
equal errors, to SciPy's functions in double precision. They are evaluated in double
precision too: next to the ends of the range, terms of both signs cancel.
"""

from __future__ import annotations

import math

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    minimum,
    select,
    sqrt,
    to_double,
    to_single,
)
from renderer.kernels.lanes.mathematics.exponentials import exp2_of_double, log2_in_double

_SIGN_BIT = -0x80000000
_MINUS_LN_2 = -math.log(2)
_STEEP = 5.0  # -log(1 - x^2) from which the tail has a polynomial of its own


@kernel
def erf(x):
    """Return 2 / sqrt(pi) times the integral of exp(-t^2) from 0 to x, of f32x16.

    Error at most 0.6 ulp. NaN gives NaN.
    """
    a = to_double(minimum(4.0, fabs(x)))  # beyond 4 it is 1 in single precision
    z = a * a
    # erf a = a P(a^2) up to 1, to 8e-11
    p = (-9.6415145330e-6 * z + 1.1256947334e-4) * z - 8.4828287608e-4
    p = ((p * z + 5.2209454266e-3) * z - 2.6865400040e-2) * z + 1.1283781974e-1
    p = (p * z - 3.7612638435e-1) * z + 1.1283791671
    # erf a = 1 - 2^-Q(a) from 1 to 4, to 3e-11
    q = (3.1303219523e-5 * a - 6.3691253916e-4) * a + 6.0669540887e-3
    q = ((q * a - 3.6370860853e-2) * a + 1.5642007084e-1) * a + 9.1353811334e-1
    q = (q * a + 1.6296399349) * a - 2.7190609741e-4
    result = select(a < 1.0, to_single(a * p), 1.0 - exp2_of_double(-q))
    return as_f32(as_i32(result) | (as_i32(x) & _SIGN_BIT))


@kernel
def erfinv(x):
    """Return the number whose error function is x, of f32x16 in [-1, 1].

    By polynomials in w = -log(1 - x^2) [Giles2011], with coefficients of our own. Error at
    most 1 ulp. The ends give infinities, what is beyond them NaN.
    """
    # 1 - x and 1 + x lose no digits next to the ends, where w is steep
    w = log2_in_double((1.0 - x) * (1.0 + x)) * _MINUS_LN_2
    # |x| < 0.9966, to 2e-9
    p = (3.3556381580e-10 * w - 1.7161881396e-8) * w + 3.0980186748e-7
    p = ((p * w - 2.4979046007e-6) * w + 5.8356910822e-6) * w + 4.0486688200e-5
    p = ((p * w - 1.2200252833e-4) * w - 2.3385406556e-3) * w + 1.1550335549e-2
    p = (p * w + 2.3201355600e-1) * w + 8.8622692745e-1
    # up to the last float32 below 1, w = 15.9, to 1.3e-8
    s = sqrt(w)
    q = (1.1010031560e-4 * s - 3.2770735197e-3) * s + 4.2928586211e-2
    q = ((q * s - 3.2390664589e-1) * s + 1.5444665318) * s - 4.7914699526
    q = ((q * s + 9.5473755802) * s - 1.1478315403e1) * s + 8.0879152039
    q = q * s - 1.5244702479
    result = to_single(to_double(x) * select(w < _STEEP, p, q))
    return select(fabs(x) == 1.0, x * math.inf, result)
