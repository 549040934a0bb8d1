"""Smooth normals on a grid of signed distances: gradients of eight cells, blended.

The gradient between grid points jumps from cell to cell. Here the cells' gradients, of
unit length in [0, 1]^3, are blended by how near their middles are [HanssonSoderlund2022].
That of a neighbour is taken at the point itself, from the numbers on the grid planes that
bound the neighbour, as Mitsuba does it.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import vec3


@kernel
def _clamped(x, most):
    return min(max(x, 0), most)


@kernel
def _distance(distances, begin, points, x, y, z):
    """Return the number at any point of a grid; outside, that of the nearest point."""
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
    """Return the slopes to both sides of the grid plane next to x, in [0, 1]^3.

    Also return the weight of the upper slope. Below the first plane there is no slope, and
    its weight is 0. Beyond the last plane Mitsuba takes the slope 0 of a constant with its
    usual weight, so normals in the last half of a cell are bent.
    """
    plane = np.round(x)
    scale = points - 1.0
    weight = 1.0 if plane < 1.0 else x - plane + 0.5
    return (here - below) * scale, (above - here) * scale, weight


@kernel
def smooth_gradient(distances, begin, points, p):
    """Return the blend of the unit gradients of eight cells, not unit.

    Parameters
    ----------
    distances, begin
        The numbers of all grids, and where those of this one begin.
    points
        How many along x, y and z.
    p
        Where; grid points are integers.
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
