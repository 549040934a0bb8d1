"""One cell of a signed distance grid: trilinear interpolation, first root, normals."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import vec3

# ---------------------------------------------------------------------------- trilinear
# Trilinear interpolation between the eight corners of a unit cube: a cubic along a ray.
#
# The first root in [0, 1] is searched between the roots of the derivative, where the
# cubic is monotone [Marmitt2004]. So no root is missed, however close two of them are.

_STEPS = 64  # steps of Newton's method, or bisections, each of which gains one bit
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
    """Return the coefficients of the trilinear polynomial of cell k.

    corners[k, x + 2 y + 4 z] is the value at corner (x, y, z) of the unit cube.
    """
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
    """Return the value and the gradient at a point."""
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
    """Return where in [0, 1] the derivative of a cubic changes its sign; 1 if nowhere."""
    a, b = 3.0 * c.c3, c.c2
    square = b * b - a * c.c1
    if not square > 0.0:
        return 1.0, 1.0
    q = -(b + np.copysign(np.sqrt(square), b))  # no cancellation: not 0
    first = c.c1 / q
    second = q / a if a != 0.0 else np.inf
    first, second = min(first, second), max(first, second)
    return min(max(first, 0.0), 1.0), min(max(second, 0.0), 1.0)


@kernel
def _bracketed_root(c, low, high, f_low, f_high):
    """Return the root in [low, high], where the cubic is monotone."""
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


# -------------------------------------------------------------------------- sdf normals
# Smooth normals on a grid of signed distances: a blend of the gradients of eight cells.
#
# The gradient of trilinear interpolation is discontinuous between cells. Here the unit
# gradients of the cells around a point are interpolated trilinearly between the cell
# centres [HanssonSoderlund2022]. As in Mitsuba, a neighbour's gradient is taken at the
# point itself, from the values on the grid planes that bound the neighbour.


@kernel
def _clamped(x, most):
    return min(max(x, 0), most)


@kernel
def _distance(distances, begin, points, x, y, z):
    """Return the interpolated distance at any point; outside, that of the nearest point."""
    most_x, most_y, most_z = points[0] - 1, points[1] - 1, points[2] - 1
    i, j, k = np.int64(np.floor(x)), np.int64(np.floor(y)), np.int64(np.floor(z))
    u, v, w = x - i, y - j, z - k
    total = 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        row = _clamped(k + c, most_z) * (most_y + 1) + _clamped(j + b, most_y)
        f = distances[begin + row * (most_x + 1) + _clamped(i + a, most_x)]
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
        total += weight * f
    return total


@kernel
def _two_slopes(below, here, above, x, points):
    """Return the slopes on both sides of the grid plane nearest to x, which is in [0, 1]^3.

    Also return the weight of the upper slope. Below the first plane there is no slope, and
    its weight is 0. Beyond the last plane Mitsuba uses the slope 0 of a constant with the
    usual weight, so normals are wrong in the last half of a cell.
    """
    plane = np.round(x)
    scale = points - 1.0
    weight = 1.0 if plane < 1.0 else x - plane + 0.5
    return (here - below) * scale, (above - here) * scale, weight


@kernel
def smooth_gradient(distances, begin, points, p):
    """Return the blend of the unit gradients of eight cells; its length is not 1.

    Parameters
    ----------
    distances, begin
        The distances of all grids, and the index of the first one of this grid.
    points
        Number of grid points along x, y and z.
    p
        Position; grid points have integer coordinates.
    """
    q = vec3(np.round(p.x), np.round(p.y), np.round(p.z))
    x0, x1, u = _two_slopes(
        _distance(distances, begin, points, q.x - 1.0, p.y, p.z),
        _distance(distances, begin, points, q.x, p.y, p.z),
        _distance(distances, begin, points, q.x + 1.0, p.y, p.z),
        p.x,
        points[0],
    )
    y0, y1, v = _two_slopes(
        _distance(distances, begin, points, p.x, q.y - 1.0, p.z),
        _distance(distances, begin, points, p.x, q.y, p.z),
        _distance(distances, begin, points, p.x, q.y + 1.0, p.z),
        p.y,
        points[1],
    )
    z0, z1, w = _two_slopes(
        _distance(distances, begin, points, p.x, p.y, q.z - 1.0),
        _distance(distances, begin, points, p.x, p.y, q.z),
        _distance(distances, begin, points, p.x, p.y, q.z + 1.0),
        p.z,
        points[2],
    )
    sum_x, sum_y, sum_z = 0.0, 0.0, 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        x, y, z = x1 if a else x0, y1 if b else y0, z1 if c else z0
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            sum_x += weight * x / length
            sum_y += weight * y / length
            sum_z += weight * z / length
    return vec3(
        sum_x / (points[0] - 1.0), sum_y / (points[1] - 1.0), sum_z / (points[2] - 1.0)
    )
