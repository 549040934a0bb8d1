"""Numbers between the eight corners of a unit cube: along a ray they are a cubic.

Its first root in [0, 1] is found piece by piece, between the roots of its derivative, where
it is monotone [Marmitt2004]. So no root is missed, however close two of them are.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import vec3

_STEPS = 64  # of Newton's method, or bisections, which gain a bit each
_CLOSE = 2.0**-50


class Trilinear(NamedTuple):
    """Coefficients of 1, x, y, z, xy, xz, yz, xyz."""

    one: Any
    x: Any
    y: Any
    z: Any
    xy: Any
    xz: Any
    yz: Any
    xyz: Any


class Cubic(NamedTuple):
    """Coefficients of 1, s, s^2, s^3."""

    c0: Any
    c1: Any
    c2: Any
    c3: Any


@kernel
def trilinear_of(corners, k):
    """Return row k of corners, of which x + 2 y + 4 z is at (x, y, z)."""
    f0, f1 = np.float64(corners[k, 0]), np.float64(corners[k, 1])
    f2, f3 = np.float64(corners[k, 2]), np.float64(corners[k, 3])
    f4, f5 = np.float64(corners[k, 4]), np.float64(corners[k, 5])
    f6, f7 = np.float64(corners[k, 6]), np.float64(corners[k, 7])
    return Trilinear(
        f0,
        f1 - f0,
        f2 - f0,
        f4 - f0,
        f3 - f2 - f1 + f0,
        f5 - f4 - f1 + f0,
        f6 - f4 - f2 + f0,
        f7 - f6 - f5 - f3 + f4 + f2 + f1 - f0,
    )


@kernel
def value_and_gradient(f, p):
    """Return both at a point."""
    value = (
        f.one
        + f.x * p.x
        + p.y * (f.y + f.xy * p.x)
        + p.z * (f.z + f.xz * p.x + p.y * (f.yz + f.xyz * p.x))
    )
    gradient = vec3(
        f.x + f.xy * p.y + p.z * (f.xz + f.xyz * p.y),
        f.y + f.xy * p.x + p.z * (f.yz + f.xyz * p.x),
        f.z + f.xz * p.x + p.y * (f.yz + f.xyz * p.x),
    )
    return value, gradient


@kernel
def cubic_along(f, p, d):
    """Return f(p + s d) as a cubic of s."""
    value, g = value_and_gradient(f, p)
    xy, yz, zx = f.xy + f.xyz * p.z, f.yz + f.xyz * p.x, f.xz + f.xyz * p.y
    return Cubic(
        value,
        g.x * d.x + g.y * d.y + g.z * d.z,
        xy * d.x * d.y + yz * d.y * d.z + zx * d.z * d.x,
        f.xyz * d.x * d.y * d.z,
    )


@kernel
def cubic_at(c, s):
    """Return the value of a cubic."""
    return c.c0 + s * (c.c1 + s * (c.c2 + s * c.c3))


@kernel
def _turns(c):
    """Return where in [0, 1] the slope of a cubic changes its sign; 1 if nowhere."""
    a, b = 3.0 * c.c3, c.c2
    square = b * b - a * c.c1
    if not square > 0.0:
        return 1.0, 1.0
    q = -(b + np.copysign(np.sqrt(square), b))  # no difference of equals: not 0
    first = c.c1 / q
    second = q / a if a != 0.0 else np.inf
    first, second = min(first, second), max(first, second)
    return min(max(first, 0.0), 1.0), min(max(second, 0.0), 1.0)


@kernel
def _bracketed_root(c, low, high, f_low, f_high):
    """Return the root between two places, where a cubic rises or falls all the way."""
    if f_low == f_high:
        return low  # both are 0
    s = low - f_low * ((high - low) / (f_high - f_low))
    for _ in range(_STEPS):
        f = cubic_at(c, s)
        if f == 0.0:
            break
        if (f > 0.0) == (f_high > f_low):
            high = s
        else:
            low = s
        slope = c.c1 + s * (2.0 * c.c2 + s * (3.0 * c.c3))
        new = s - f / slope if slope != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        step = abs(new - s)
        s = new
        if step <= _CLOSE:
            break
    return s


@kernel
def first_root_of(c):
    """Return the smallest root of a cubic in [0, 1], infinite without a root."""
    first, second = _turns(c)
    low, f_low = 0.0, c.c0
    for piece in range(3):
        high = first if piece == 0 else second if piece == 1 else 1.0
        f_high = cubic_at(c, high)
        if f_low <= 0.0 <= f_high or f_high <= 0.0 <= f_low:
            return _bracketed_root(c, low, high, f_low, f_high)
        low, f_low = high, f_high
    return np.inf
