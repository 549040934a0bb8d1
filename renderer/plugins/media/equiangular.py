"""Equiangular sampling: places along a ray by how much a small lamp lights them.

The light of a lamp at the distance r falls with 1 / r^2. The place t of a segment gets the
density of that, by the angle under which the lamp sees the segment [Kulla2012]; of several
lamps that of the sum of I / r^2, so that a place close to any of them is likely. Places lie
within two mean free paths: of what is farther away, little light arrives.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import arctan2, sincos
from renderer.kernels.lanes.memory import gather_row, load_one
from renderer.kernels.lanes.vectors import column3, dot, gather3
from renderer.plugins.media.free_flight import attenuated_sigma_t, mean

# rows of the table of lamps, after the centre
RADIUS2, STRENGTH = 3, 4
# End of the sampled range, in mean free paths. With 4 a picture has the same variance and
# takes 1.1 times the time.
FREE_PATHS = np.float32(2.0)
# So many times more light at the nearest place of a segment than at the farthest one make
# it worth a point. At 5 and 25 the gain is 0.9 and 1.0 times as large.
_UNEVEN = np.float32(16.0)
# A lamp counts as no closer to a ray than 1/1000 of the way to its foot: float32 could not
# tell the angles of far places of a ray through a lamp.
_NEAREST2 = np.float32(1e-6)
_TINY = np.float32(1e-20)


class Foot(NamedTuple):
    """The point of a ray's line that is closest to a lamp."""

    t: Any
    distance2: Any  # squared distance of the centre, plus the squared radius


@kernel
def segment_end(media, medium, end, mask):
    """Return the end of the sampled range, at most `end`; 0 in heterogeneous media."""
    even = mask & ~(gather_row(media.majorant, 0, medium, mask) > 0.0)
    sigma = mean(gather3(media.sigma_t, medium, even))
    there = even & (sigma > 0.0)
    longest = FREE_PATHS / select(there, sigma, splat_f32(1.0))
    return select(there, minimum(end, longest), splat_f32(0.0))


@kernel
def _foot(lamps, k, origin, direction):
    to_lamp = column3(lamps, 0, k) - origin
    t = dot(to_lamp, direction)
    across = to_lamp - direction * t
    distance2 = dot(across, across) + load_one(lamps, RADIUS2, k)
    return Foot(t, maximum(distance2, t * t * _NEAREST2 + _TINY))


@kernel
def is_uneven(lamps, origin, direction, end):
    """Return which segments lamps light much more at one place than at another."""
    most, least = splat_f32(0.0), splat_f32(0.0)
    for k in range(lamps.shape[1]):
        foot, strength = _foot(lamps, k, origin, direction), load_one(lamps, STRENGTH, k)
        near = minimum(maximum(foot.t, splat_f32(0.0)), end) - foot.t
        far = maximum(foot.t, end - foot.t)
        most = most + strength / (foot.distance2 + near * near)
        least = least + strength / (foot.distance2 + far * far)
    return most > least * _UNEVEN


@kernel
def light_at(lamps, origin, direction, t):
    """Return the sum of I / r^2 at places t of rays."""
    total = splat_f32(0.0)
    for k in range(lamps.shape[1]):
        foot = _foot(lamps, k, origin, direction)
        r2 = foot.distance2 + (t - foot.t) * (t - foot.t)
        total = total + load_one(lamps, STRENGTH, k) / r2
    return total


@kernel
def _part(lamps, k, origin, direction, end):
    """Return the foot of lamp k, its distance, its first angle, and its integral."""
    foot, strength = _foot(lamps, k, origin, direction), load_one(lamps, STRENGTH, k)
    distance = sqrt(foot.distance2)
    first, last = arctan2(-foot.t, distance), arctan2(end - foot.t, distance)
    return foot.t, distance, first, (last - first) * strength / distance


@kernel
def sample_place(lamps, origin, direction, end, x):
    """Return t in [0, end] for x in [0, 1), and the integral of `light_at` over it."""
    total = splat_f32(0.0)
    for k in range(lamps.shape[1]):
        _, _, _, part = _part(lamps, k, origin, direction, end)
        total = total + part
    left, t = total * x, splat_f32(0.0)
    open_ = left >= 0.0
    for k in range(lamps.shape[1]):
        foot, distance, first, part = _part(lamps, k, origin, direction, end)
        inside = minimum(left, part)  # rounding may leave more than the last lamp has
        sine, cosine = sincos(first + inside * distance / load_one(lamps, STRENGTH, k))
        t = select(open_, foot + distance * (sine / cosine), t)
        open_ = open_ & ~(left < part)
        left = left - part
    return minimum(maximum(t, splat_f32(0.0)), end), total


@kernel
def flight_weight(media, lamps, medium, origin, direction, t, total, mask):
    """Return the weights of light samples at collisions at t.

    `total` is the integral of `light_at`; 0 where the segment has no second point.
    """
    mask = mask & (total > 0.0)
    if mask_bits(mask) == 0:
        return splat_f32(1.0)
    mask = mask & (t <= segment_end(media, medium, t, mask))
    flight = mean(attenuated_sigma_t(media, medium, t, mask))
    other = light_at(lamps, origin, direction, t) / total
    return select(mask, flight / (flight + other), splat_f32(1.0))
