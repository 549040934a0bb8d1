"""Ray-box tests for one ray or 16, conservative under rounding.

No hit may be missed: the exit distance is stretched, and the origin is moved down and up,
by bounds of the rounding errors.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, maximum, minimum, select, splat_f32
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.shapes.extents import ROUNDING

# The exit distance of a slab is multiplied by 1 + 2 gamma(3), which closes the holes that
# rounding would leave in the boxes of flat primitives [Ize2013].
STRETCH = np.float32(1.0000004)
# Boxes are enlarged by this fraction of the origin's coordinates (32 units in the last
# place), and `primitive_bounds` pads by the same fraction of the box's own: the rounding of
# a hit's t and (u, v) must not put the hit outside of its box.
MARGIN = ROUNDING
# Components of a direction are clamped to at least this share of the largest. The ray moves
# by less than a rounding error, and no product below is 0 * inf or overflows.
LEAST_COMPONENT = np.float32(1e-12)
_INFINITY = np.float32(np.inf)


@kernel
def origin_margins(origin):
    """Return the origin minus and plus the margin along every axis."""
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    return origin - far * MARGIN, origin + far * MARGIN


@kernel
def packet_enters(bounds, node, low, high, inverse, t):
    """Return the mask of the 16 rays that enter a node's box before t.

    An axis-parallel ray in a slab's plane gives 0 * inf = NaN. `minimum` and `maximum`
    then return their second operand. So each distance is first compared with the running
    bound, and such a ray counts as inside the slab.
    """
    x0 = (bounds[node, 0] - high.x) * inverse.x
    x1 = (bounds[node, 3] - low.x) * inverse.x
    y0 = (bounds[node, 1] - high.y) * inverse.y
    y1 = (bounds[node, 4] - low.y) * inverse.y
    z0 = (bounds[node, 2] - high.z) * inverse.z
    z1 = (bounds[node, 5] - low.z) * inverse.z
    zero = splat_f32(0.0)
    enter = minimum(maximum(x0, zero), maximum(x1, zero))
    enter = minimum(maximum(y0, enter), maximum(y1, enter))
    enter = minimum(maximum(z0, enter), maximum(z1, enter))
    leave = maximum(minimum(x0 * STRETCH, t), minimum(x1 * STRETCH, t))
    leave = maximum(minimum(y0 * STRETCH, leave), minimum(y1 * STRETCH, leave))
    leave = maximum(minimum(z0 * STRETCH, leave), minimum(z1 * STRETCH, leave))
    return enter <= leave


@kernel
def _later(a, bound):
    """Return the larger; `bound` where a is NaN."""
    return a if a > bound else bound


@kernel
def _sooner(a, bound):
    """Return the smaller; `bound` where a is NaN."""
    return a if a < bound else bound


@kernel
def ray_enters(bounds, node, low, high, inverse, t):
    """Return the t at which one ray enters a node's box, or infinity if not before t."""
    x0 = (bounds[node, 0] - high.x) * inverse.x
    x1 = (bounds[node, 3] - low.x) * inverse.x
    y0 = (bounds[node, 1] - high.y) * inverse.y
    y1 = (bounds[node, 4] - low.y) * inverse.y
    z0 = (bounds[node, 2] - high.z) * inverse.z
    z1 = (bounds[node, 5] - low.z) * inverse.z
    enter = np.float32(0.0)
    enter = _sooner(_later(x0, enter), _later(x1, enter))
    enter = _sooner(_later(y0, enter), _later(y1, enter))
    enter = _sooner(_later(z0, enter), _later(z1, enter))
    leave = _later(_sooner(x0 * STRETCH, t), _sooner(x1 * STRETCH, t))
    leave = _later(_sooner(y0 * STRETCH, leave), _sooner(y1 * STRETCH, leave))
    leave = _later(_sooner(z0 * STRETCH, leave), _sooner(z1 * STRETCH, leave))
    return enter if enter <= leave else _INFINITY


@kernel
def _away_from_zero(d, least):
    return select(fabs(d) > least, d, select(d < 0.0, -least, least))


@kernel
def safe_reciprocal(direction):
    """Return 1 / d for each component of one ray or 16.

    The result is finite, unless the direction is 0 or shorter than 1e-26.
    """
    x, y, z = fabs(direction.x), fabs(direction.y), fabs(direction.z)
    largest = select(x > y, x, y)
    least = select(z > largest, z, largest) * LEAST_COMPONENT
    one = np.float32(1.0)
    return vec3(
        one / _away_from_zero(direction.x, least),
        one / _away_from_zero(direction.y, least),
        one / _away_from_zero(direction.z, least),
    )
