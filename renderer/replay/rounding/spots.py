"""Spot lights in a replay: Mitsuba's way to the angle from the axis.

The angle of a cosine c is off by the rounding of c over the sine, and a falloff over a few
degrees by that over their width: near the rim, where it is small, by 1e-3 of itself. With
the same operations all bits of 2000 of 2000 samples agreed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, maximum, select, splat_f32, sqrt
from renderer.kernels.lanes.mathematics.mathematics import arccos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather_rows3, gather_vectors, length
from renderer.plugins.lights.finite.spot import (
    SpotLights,
    axis_cosine,
    falling_off,
    spot_falloff,
)
from renderer.plugins.lights.kind import sample_light
from renderer.replay.rounding.arithmetic.arcs import arccos_as_mitsuba
from renderer.replay.rounding.arithmetic.fused_lanes import fused
from renderer.scene_file.description import SpotLight

_COSINE = np.float32(3e-7)  # what rounds a cosine near 1: five units in the last place

_WIDTH = np.float32(2.0**-23)  # of the cutoff: what rounds the width of a rim


class RoundedSpots(NamedTuple):
    """Spot lights with both ways to round; columns by light id."""

    own: SpotLights
    theirs: SpotLights  # with the widths of their rims rounded as there
    to_local: NDArray[np.float32]  # (9, n) rows of the matrices from the world


def rounded_spots(own: SpotLights, lights: dict[int, SpotLight]) -> RoundedSpots:
    """Return what a replay needs of spot lights, by light id."""
    to_local = np.zeros((9, own.cutoff.size), np.float32)
    for light, spot in lights.items():
        to_local[:, light] = np.linalg.inv(spot.to_world[:3, :3] * spot.scale).ravel()
    degrees = np.float32(np.pi / 180.0)
    inverse = own.inverse_transition.copy()
    for light, spot in lights.items():
        width = np.float32(spot.cutoff_angle) * degrees
        width = width - np.float32(spot.beam_width) * degrees
        if width > 0.0 and inverse[light] > 0.0:
            inverse[light] = np.float32(1.0) / width
    return RoundedSpots(own, own._replace(inverse_transition=inverse), to_local)


@kernel
def _along(matrix, row, light, d, mask):
    a = gather_rows3(matrix, row, light, mask)
    return fused(a.z, d.z, fused(a.y, d.y, a.x * d.x))


@kernel
def _inverse_length(x, y, z):
    return 1.0 / sqrt((x * x + z * z) + y * y)


@kernel
def _cosine(spots, light, to_light, mask):
    away = to_light * -_inverse_length(to_light.x, to_light.y, to_light.z)
    x = _along(spots.to_local, 0, light, away, mask)
    y = _along(spots.to_local, 3, light, away, mask)
    z = _along(spots.to_local, 6, light, away, mask)
    return z * _inverse_length(x, y, z)


@sample_light.by(RoundedSpots)
@kernel
def _sample(spots, kind, light, mask, position, x, y, z):
    """Take Mitsuba's falloff where it is off ours by no more than a cosine's rounding."""
    own = spots.own
    to_light = gather_vectors(own.position, light, mask) - position
    cosine = axis_cosine(own, light, to_light / length(to_light), mask)
    falloff = spot_falloff(own, light, cosine, arccos(cosine), mask)
    theirs = _cosine(spots, light, to_light, mask)
    rounded = spot_falloff(spots.theirs, light, theirs, arccos_as_mitsuba(theirs), mask)
    sine = sqrt(maximum(1.0 - cosine * cosine, splat_f32(2.0 * _COSINE)))
    angle = _COSINE / sine + falloff * (_WIDTH * gather_row(own.cutoff, 0, light, mask))
    most = angle * gather_row(own.inverse_transition, 0, light, mask)
    falloff = select(fabs(rounded - falloff) <= most, rounded, falloff)
    return falling_off(own, light, to_light, cosine, falloff, mask)
