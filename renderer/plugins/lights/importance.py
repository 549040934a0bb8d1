"""What a light, or all below a node of the tree of lights, can give at a point.

    strength / max(d^2, r^2) cos(theta_light) cos(theta_surface)

Both cosines are as large as any point of the ball of radius r may make them [Estevez2018,
section 5.3; Pharr2023, section 12.6.3], but for one thing. In place of the cosine of an
angle less the half angle b under which the ball is seen stands its cosine plus sin b, at
most 1. That is positive wherever theirs is, which is all that a choice needs to have no
bias, and takes four roots and two divisions less.
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

# On which sides of a surface lights can contribute, by BSDF
IN_FRONT = 0  # it is opaque: what lies behind it gives nothing
BOTH_SIDES = 1  # light goes through
ANY_NORMAL = 2  # a normal or bump map turns the normal by an unknown angle


@table_columns("bounds")
class LightNodes(NamedTuple):
    """Bounds as the kernels see them, `light_tree.LightBounds`; columns by node."""

    # (12, m) center (world), radius (not 0: see `light_tree._nodes`), axis (unit; at
    # infinity towards the light), strength (in parts of the largest), cosine and sine of
    # the spread, cosine of the reach, unused
    bounds: NDArray[np.float32]


class Receiver(NamedTuple):
    """Sixteen surface points for which a light is chosen."""

    position: Any
    normal: Any  # shading normal, of the side that is seen
    through: Any  # mask: BOTH_SIDES
    any_normal: Any  # mask: ANY_NORMAL


@kernel
def _less_spread(cosine, cos_spread, sin_spread):
    """Return the cosine of max(0, a - spread), of angles from 0 to pi."""
    sine = sqrt(maximum(1.0 - cosine * cosine, splat_f32(0.0)))
    within = cosine > cos_spread
    return select(within, splat_f32(1.0), cosine * cos_spread + sine * sin_spread)


@kernel
def _at_surface(receiver, cosine, more):
    """Return the largest cosine at the surface, up to an angle whose sine is `more`."""
    cosine = select(receiver.through, fabs(cosine), cosine)
    cosine = minimum(maximum(cosine + more, splat_f32(0.0)), splat_f32(1.0))
    return select(receiver.any_normal, splat_f32(1.0), cosine)


class _Ball(NamedTuple):
    """A ball of lights as 16 points see it."""

    to_light: Any  # to its center
    inverse: Any  # 1 / max(d, r)
    inverse2: Any  # its square
    sine: Any  # of half the angle that it fills
    outside: Any  # mask of the points that are not in it


@kernel
def _ball(center, radius, receiver):
    to_light = center - receiver.position
    d2, r2 = dot(to_light, to_light), radius * radius
    inverse2 = 1.0 / maximum(d2, r2)
    inverse = sqrt(inverse2)
    return _Ball(to_light, inverse, inverse2, radius * inverse, d2 > r2)


@kernel
def _given(receiver, ball, cosine, strength, cos_reach):
    """Return what a ball gives whose light falls off by `cosine` from its axis."""
    cosine = minimum(cosine + ball.sine, splat_f32(1.0))
    cosine = select(ball.outside, cosine, splat_f32(1.0))
    to_ball = dot(receiver.normal, ball.to_light) * ball.inverse
    surface = _at_surface(receiver, to_ball, ball.sine)
    given = strength * cosine * surface * ball.inverse2
    return select(cosine > cos_reach, given, splat_f32(0.0))


@kernel
def importance_of(nodes, node, receiver):
    """Return what one node in a finite place can give at 16 points."""
    bounds = nodes.bounds
    radius = splat_f32(load_one(bounds, 3, node))
    ball = _ball(column3(bounds, 0, node), radius, receiver)
    cosine = -dot(column3(bounds, 4, node), ball.to_light) * ball.inverse
    cos_spread = load_one(bounds, 8, node)
    if cos_spread < 1.0:  # not flat
        sin_spread = load_one(bounds, 9, node)
        cosine = _less_spread(cosine, splat_f32(cos_spread), splat_f32(sin_spread))
    strength, cos_reach = load_one(bounds, 7, node), load_one(bounds, 10, node)
    return _given(receiver, ball, cosine, strength, cos_reach)


@kernel
def importance_from_infinity(nodes, node, receiver):
    """Return what one light at infinity gives at 16 points, which lie anywhere."""
    bounds = nodes.bounds
    strength = load_one(bounds, 7, node)
    if load_one(bounds, 8, node) <= 0.0:  # from everywhere
        return splat_f32(strength)
    cosine = dot(receiver.normal, column3(bounds, 4, node))
    sin_spread = splat_f32(load_one(bounds, 9, node))
    return _at_surface(receiver, cosine, sin_spread) * strength


@kernel
def importance_at(nodes, node, mask, receiver):
    """Return what one node per point can give at each of 16 points."""
    x, y, z, radius = gather_columns(nodes.bounds, 0, node, mask)
    u, v, w, strength = gather_columns(nodes.bounds, 4, node, mask)
    cos_spread, sin_spread, cos_reach, _ = gather_columns(nodes.bounds, 8, node, mask)
    ball = _ball(vec3(x, y, z), radius, receiver)
    cosine = -dot(vec3(u, v, w), ball.to_light) * ball.inverse
    cosine = _less_spread(cosine, cos_spread, sin_spread)
    return _given(receiver, ball, cosine, strength, cos_reach)
