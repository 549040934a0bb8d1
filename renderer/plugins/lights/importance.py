"""Importance of a light, or of a node of the light tree, at a point.

    strength / max(d^2, r^2) cos(theta_light) cos(theta_surface)

Both cosines are upper bounds over the bounding ball of radius r [Estevez2018, section 5.3;
Pharr2023, section 12.6.3], with one change. Let b be the half angle that the ball subtends.
Instead of cos(theta - b), this uses cos(theta) + sin(b), at most 1. It is positive wherever
the original is positive, which is sufficient for an unbiased selection, and needs four
square roots and two divisions less.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import (
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.memory import gather_columns, load_one
from renderer.kernels.lanes.vectors import column3, dot, vec3

# For each BSDF, the side of the surface on which lights contribute
IN_FRONT = 0  # opaque: lights behind the surface contribute nothing
BOTH_SIDES = 1  # the BSDF transmits
ANY_NORMAL = 2  # a normal or bump map turns the normal by an unknown angle


@table_columns("bounds")
class LightNodes(NamedTuple):
    """Bounds (`light_tree.LightBounds`) as arrays for the kernels; columns by node."""

    # (12, m) centre (world), radius (not 0: see `light_tree._nodes`), axis (unit; at
    # infinity towards the light), strength (relative to the largest), cosine and sine of
    # the spread, cosine of the reach, unused
    bounds: NDArray[np.float32]


class Receiver(NamedTuple):
    """Sixteen surface points for which a light is selected."""

    position: Any
    normal: Any  # shading normal, on the side of wo
    through: Any  # mask: BOTH_SIDES
    any_normal: Any  # mask: ANY_NORMAL


@kernel
def _less_spread(cosine, cos_spread, sin_spread):
    """Return cos(max(0, a - spread)) for angles a in [0, pi]."""
    sine = sqrt(maximum(1.0 - cosine * cosine, splat_f32(0.0)))
    within = cosine > cos_spread
    return select(within, splat_f32(1.0), cosine * cos_spread + sine * sin_spread)


@kernel
def _at_surface(receiver, cosine, more):
    """Return an upper bound of the cosine at the surface; `more` is sin(b) of the ball."""
    cosine = select(receiver.through, fabs(cosine), cosine)
    cosine = minimum(maximum(cosine + more, splat_f32(0.0)), splat_f32(1.0))
    return select(receiver.any_normal, splat_f32(1.0), cosine)


class _Ball(NamedTuple):
    """A bounding ball of lights, relative to 16 points."""

    to_light: Any  # to its center
    inverse: Any  # 1 / max(d, r)
    inverse2: Any  # its square
    sine: Any  # of the half angle that it subtends
    outside: Any  # mask of the points outside of the ball


@kernel
def _ball(center, radius, receiver):
    to_light = center - receiver.position
    d2, r2 = dot(to_light, to_light), radius * radius
    inverse2 = 1.0 / maximum(d2, r2)
    inverse = sqrt(inverse2)
    return _Ball(to_light, inverse, inverse2, radius * inverse, d2 > r2)


@kernel
def _given(receiver, ball, cosine, strength, cos_reach):
    """Return the importance of a ball; `cosine` is that of its axis and the direction."""
    cosine = minimum(cosine + ball.sine, splat_f32(1.0))
    cosine = select(ball.outside, cosine, splat_f32(1.0))
    to_ball = dot(receiver.normal, ball.to_light) * ball.inverse
    surface = _at_surface(receiver, to_ball, ball.sine)
    given = strength * cosine * surface * ball.inverse2
    return select(cosine > cos_reach, given, splat_f32(0.0))


@kernel
def importance_of(nodes, node, receiver):
    """Return the importance of one finite node at 16 points."""
    bounds = nodes.bounds
    radius = splat_f32(load_one(bounds, 3, node))
    ball = _ball(column3(bounds, 0, node), radius, receiver)
    cosine = -dot(column3(bounds, 4, node), ball.to_light) * ball.inverse
    cos_spread = load_one(bounds, 8, node)
    if cos_spread < 1.0:  # not all emission is along one axis
        sin_spread = load_one(bounds, 9, node)
        cosine = _less_spread(cosine, splat_f32(cos_spread), splat_f32(sin_spread))
    strength, cos_reach = load_one(bounds, 7, node), load_one(bounds, 10, node)
    return _given(receiver, ball, cosine, strength, cos_reach)


@kernel
def importance_from_infinity(nodes, node, receiver):
    """Return the importance of one light at infinity for 16 points."""
    bounds = nodes.bounds
    strength = load_one(bounds, 7, node)
    if load_one(bounds, 8, node) <= 0.0:  # environment: emits from all directions
        return splat_f32(strength)
    cosine = dot(receiver.normal, column3(bounds, 4, node))
    sin_spread = splat_f32(load_one(bounds, 9, node))
    return _at_surface(receiver, cosine, sin_spread) * strength


@kernel
def importance_at(nodes, node, mask, receiver):
    """Return the importance of a different node for each of 16 points."""
    x, y, z, radius = gather_columns(nodes.bounds, 0, node, mask)
    u, v, w, strength = gather_columns(nodes.bounds, 4, node, mask)
    cos_spread, sin_spread, cos_reach, _ = gather_columns(nodes.bounds, 8, node, mask)
    ball = _ball(vec3(x, y, z), radius, receiver)
    cosine = -dot(vec3(u, v, w), ball.to_light) * ball.inverse
    cosine = _less_spread(cosine, cos_spread, sin_spread)
    return _given(receiver, ball, cosine, strength, cos_reach)
