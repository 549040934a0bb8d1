"""What a light, or all below a node of the tree of lights, can give at a point at most.

    strength / max(d^2, r^2) cos(theta_light) cos(theta_surface)

Both cosines are the largest that any point of the ball of radius r can have at distance
d [Estevez2018, section 5.3; Pharr2023, section 12.6.3].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import column, dot, gather3

# On which sides of a surface lights can contribute, by BSDF
IN_FRONT = 0  # it is opaque: what lies behind it gives nothing
BOTH_SIDES = 1  # light goes through
ANY_NORMAL = 2  # a normal or bump map turns the normal by an unknown angle

_SMALLEST = np.float32(1.1754944e-38)


class LightNodes(NamedTuple):
    """Bounds as the kernels see them, `light_tree.LightBounds`; columns by node."""

    center: NDArray[np.float32]  # (3, m) world
    axis: NDArray[np.float32]  # (3, m) unit; at infinity towards the light
    strength: NDArray[np.float32]  # (m,) in parts of the largest
    radius2: NDArray[np.float32]  # (m,) squared, and not 0: see `light_tree.light_nodes`
    cos_spread: NDArray[np.float32]  # (m,)
    sin_spread: NDArray[np.float32]  # (m,)
    cos_reach: NDArray[np.float32]  # (m,)


class Receiver(NamedTuple):
    """Sixteen surface points for which a light is chosen."""

    position: Any
    normal: Any  # shading normal, of the side that is seen
    through: Any  # mask: BOTH_SIDES
    any_normal: Any  # mask: ANY_NORMAL


@kernel
def _narrowed(cos_a, sin_a, cos_b, sin_b):
    """Return cosine and sine of max(0, a - b), of angles from 0 to pi."""
    none = cos_a > cos_b
    cosine = cos_a * cos_b + sin_a * sin_b
    sine = sin_a * cos_b - cos_a * sin_b
    return select(none, splat_f32(1.0), cosine), select(none, splat_f32(0.0), sine)


@kernel
def _sine(cosine):
    return sqrt(maximum(1.0 - cosine * cosine, splat_f32(0.0)))


@kernel
def _on_surface(receiver, wi, cos_ball, sin_ball):
    """Return the largest cosine at the surface of directions within a cone around wi."""
    cosine = dot(receiver.normal, wi)
    cosine = select(receiver.through, fabs(cosine), cosine)
    cosine, _ = _narrowed(cosine, _sine(cosine), cos_ball, sin_ball)
    return select(receiver.any_normal, splat_f32(1.0), maximum(cosine, splat_f32(0.0)))


@kernel
def _of_ball(receiver, center, axis, strength, radius2, cos_spread, sin_spread, cos_reach):
    to_light = center - receiver.position
    d2 = dot(to_light, to_light)
    wi = to_light * (1.0 / sqrt(maximum(d2, splat_f32(_SMALLEST))))
    # the half angle under which the ball is seen; from inside it is everywhere
    outside = d2 > radius2
    sine2 = minimum(radius2 / maximum(d2, splat_f32(_SMALLEST)), splat_f32(1.0))
    sin_ball = select(outside, sqrt(sine2), splat_f32(0.0))
    cos_ball = select(outside, sqrt(1.0 - sine2), splat_f32(-1.0))
    # off the axis: less the cone where it shines in full, less the ball
    cosine = -dot(axis, wi)
    cosine, sine = _narrowed(cosine, _sine(cosine), cos_spread, sin_spread)
    cosine, _ = _narrowed(cosine, sine, cos_ball, sin_ball)
    surface = _on_surface(receiver, wi, cos_ball, sin_ball)
    given = strength * cosine * surface / maximum(d2, radius2)
    return select(cosine > cos_reach, given, splat_f32(0.0))


@kernel
def importance_of(nodes, node, receiver):
    """Return what one node in a finite place can give at 16 points."""
    return _of_ball(
        receiver,
        column(nodes.center, node),
        column(nodes.axis, node),
        nodes.strength[node],
        splat_f32(nodes.radius2[node]),
        splat_f32(nodes.cos_spread[node]),
        splat_f32(nodes.sin_spread[node]),
        nodes.cos_reach[node],
    )


@kernel
def importance_from_infinity(nodes, node, receiver):
    """Return what one light at infinity gives at 16 points, which lie anywhere."""
    cos_spread = splat_f32(nodes.cos_spread[node])
    sin_spread = splat_f32(nodes.sin_spread[node])
    wi = column(nodes.axis, node)
    return nodes.strength[node] * _on_surface(receiver, wi, cos_spread, sin_spread)


@kernel
def importance_at(nodes, node, mask, receiver):
    """Return what one node per point can give at each of 16 points."""
    return _of_ball(
        receiver,
        gather3(nodes.center, node, mask),
        gather3(nodes.axis, node, mask),
        gather_row(nodes.strength, 0, node, mask),
        gather_row(nodes.radius2, 0, node, mask),
        gather_row(nodes.cos_spread, 0, node, mask),
        gather_row(nodes.sin_spread, 0, node, mask),
        gather_row(nodes.cos_reach, 0, node, mask),
    )
