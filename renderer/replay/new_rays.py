"""Stage 6 in a replay: origins of scattered rays with Mitsuba's rounding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.vectors import column, dot
from renderer.replay.arithmetic import fused_sum

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_ORIGIN_ROUNDING = np.float32(1e-6)  # a hundredth of the ray offset


@kernel
def _close(a, b, limit):
    """Return whether two vectors differ by rounding only; NaN differs from everything."""
    return abs(a.x - b.x) <= limit and abs(a.y - b.y) <= limit and abs(a.z - b.z) <= limit


@kernel
def _size(p):
    return _ONE + max(abs(p.x), max(abs(p.y), abs(p.z)))


@kernel
def _off_surface(points, i, direction, fixed):
    """Return the offset origin of a ray in a direction, by Mitsuba's rule."""
    p, normal = column(points.position, i), column(points.normal, i)
    size = _size(p) * fixed
    if dot(normal, direction) < _ZERO:
        size = -size
    return fused_sum(normal, size, p)


class Leaving(NamedTuple):
    """The record of the hook; it has no fields."""


@method_kernel
def round_rays(leaving, settings, rays, end, points):
    """Round the origins of the first `end` rays, which have just left `points`.

    An origin that differs by more than rounding is kept, so that a replay shows it. Also
    stores the exact position that each ray leaves.
    """
    fixed = np.float32(settings.fixed_offset)
    for k in range(end):
        i = rays.point[k]
        for c in range(3):
            rays.previous[c, k] = points.position[c, i]
        origin = _off_surface(points, i, column(rays.direction, k), fixed)
        if _close(origin, column(rays.origin, k), _ORIGIN_ROUNDING * _size(origin)):
            rays.origin[0, k], rays.origin[1, k] = origin.x, origin.y
            rays.origin[2, k] = origin.z
