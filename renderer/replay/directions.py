"""Directions from surfaces in a replay, with Mitsuba's rounding.

Mitsuba's wheels fuse multiplications and additions, and its sine and cosine arrange Cephes'
polynomials differently from ours. With the same operations a direction is the same 32
bits. So two paths part only where a decision is within rounding. The fused operations were
found by trial: 2000 of 2000 samples of a `diffuse` BSDF agreed in all bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    maximum,
    select,
    splat_f32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.vectors import (
    dot,
    length,
    load3,
    orthonormal_basis,
    select3,
    vec3,
)
from renderer.plugins.bsdfs.hair import theta_of_last_lobe
from renderer.plugins.bsdfs.mirror import refracted
from renderer.plugins.sampling.numbers_and_warps import (
    cosine_direction,
    density_normal,
    seen_from,
    tangents_of,
    to_world,
)
from renderer.plugins.shapes.sphere import (
    cone_of_density,
    even_part_of_cone,
    exact_cone_of_density,
    near_surface,
    part_of_cone,
)
from renderer.replay.arithmetic import fused

_QUARTER_PI = np.float32(0.25) * np.float32(np.pi)
_HALF_PI = np.float32(0.5) * np.float32(np.pi)
_FOUR_OVER_PI = np.float32(1.2732395447351626862)
# pi / 4 in three parts, the first of few bits [Moshier1989]
_PART_1 = np.float32(0.78515625)
_PART_2 = np.float32(2.4187564849853515625e-4)
_PART_3 = np.float32(3.77489497744594108e-8)
_SINE = tuple(np.float32(c) for c in (-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4))
_COSINE = tuple(
    np.float32(c)
    for c in (4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5)
)
_SIGN_BIT = -0x80000000
_LOST = np.float32(3e-7)  # rounding error of the difference 1 - cos
_NARROW = np.float32(0.00068523)  # sin^2 of 1.5 degrees


@kernel
def _polynomial(coefficients, z):
    """Return ((c0 + c1 z) + c2 z^2) z."""
    low = fused(z, coefficients[1], splat_f32(coefficients[0]))
    return fused(z * z, coefficients[2], low) * z


@kernel
def sincos_as_mitsuba(x):
    """Return (sin x, cos x) of f32x16 angles, |x| < 8192."""
    magnitude = fabs(x)
    eighth = (to_i32(magnitude * _FOUR_OVER_PI) + 1) & -2  # octants, the nearest even one
    turns = to_f32(eighth)
    y = fused(-turns, _PART_1, magnitude)
    y = fused(-turns, _PART_2, y)
    y = fused(-turns, _PART_3, y)
    z = y * y
    sine = fused(_polynomial(_SINE, z), y, y)
    cosine = fused(_polynomial(_COSINE, z), z, fused(z, np.float32(-0.5), splat_f32(1.0)))
    swap = (eighth & 2) != 0
    sine_sign = ((eighth << 29) ^ as_i32(x)) & _SIGN_BIT
    cosine_sign = (~(eighth - 2) << 29) & _SIGN_BIT
    return (
        as_f32(as_i32(select(swap, cosine, sine)) ^ sine_sign),
        as_f32(as_i32(select(swap, sine, cosine)) ^ cosine_sign),
    )


@kernel
def disk_as_mitsuba(x, y):
    """Map [0, 1)^2 to the unit disk, as `square_to_disk` except for rounding."""
    a = x * 2.0 - 1.0
    b = y * 2.0 - 1.0
    steep = fabs(a) < fabs(b)
    radius = select(steep, b, a)
    ratio = _QUARTER_PI * select(steep, a, b)
    angle = ratio / select(radius == 0.0, splat_f32(1.0), radius)
    angle = select(steep, _HALF_PI - angle, angle)
    sine, cosine = sincos_as_mitsuba(angle)
    return radius * cosine, radius * sine


@kernel
def cosine_hemisphere_as_mitsuba(x, y):
    """Map [0, 1)^2 to unit vectors around +z with density cos / pi."""
    p, q = disk_as_mitsuba(x, y)
    z2 = 1.0 - fused(p, p, q * q)
    return vec3(p, q, sqrt(maximum(z2, splat_f32(0.0))))


@kernel
def fused_sum(a, s, b):
    """Return a s + b for vectors a, b and lanes s."""
    return vec3(fused(a.x, s, b.x), fused(a.y, s, b.y), fused(a.z, s, b.z))


@kernel
def fused_cross(a, b):
    """Return a x b; in each component the second product is rounded first."""
    return vec3(
        fused(a.y, b.z, -(a.z * b.y)),
        fused(a.z, b.x, -(a.x * b.z)),
        fused(a.x, b.y, -(a.y * b.x)),
    )


@kernel
def squared_length(a):
    """Return |a|^2, summed as in four lanes: first x and z, then y."""
    return (a.x * a.x + a.z * a.z) + a.y * a.y


@kernel
def frame_as_mitsuba(along_u, normal):
    """Return the shading frame's two tangents, from dp/du and the normal."""
    across = fused_sum(normal, -dot(normal, along_u), along_u)
    s = across * (1.0 / sqrt(squared_length(across)))
    return s, fused_cross(normal, s)


@kernel
def to_world_as_mitsuba(s, t, normal, local):
    """Return the direction with components `local` along s, t and the normal."""
    return fused_sum(normal, local.z, fused_sum(t, local.y, s * local.x))


# ------------------------------------------------- implementations of stage interfaces


class AsMitsuba(NamedTuple):
    """Directions and densities with the rounding of Mitsuba's scalar variants."""

    ray_epsilon: float  # see `MitsubaRules`


@cosine_direction.by(AsMitsuba)
@kernel
def _cosine_direction(arithmetic, x, y):
    return cosine_hemisphere_as_mitsuba(x, y)


@refracted.by(AsMitsuba)
@kernel
def _refracted(arithmetic, wo, eta, cos_t):
    ratio = select(wo.z >= 0.0, 1.0 / eta, eta)
    sine2 = fused(-wo.z, wo.z, splat_f32(1.0))
    cosine = sqrt(maximum(fused(-sine2, ratio * ratio, splat_f32(1.0)), splat_f32(0.0)))
    z = select(wo.z >= 0.0, -cosine, cosine)
    return vec3(-(wo.x * ratio), -(wo.y * ratio), z)


@theta_of_last_lobe.by(AsMitsuba)
@kernel
def _theta_of_last_lobe(arithmetic, sine, cosine):
    return sine * 0.0, cosine * 0.0


@to_world.by(AsMitsuba)
@kernel
def _to_world(arithmetic, frame, local):
    return to_world_as_mitsuba(frame.s, frame.t, frame.n, local)


@tangents_of.by(AsMitsuba)
@kernel
def _tangents_of(arithmetic, points, i, normal):
    """Return Mitsuba's frame; the first tangent is dp/du without its normal component.

    Seen from behind, Mitsuba flips z but not x and y, so the frame is left-handed.
    """
    s, t = orthonormal_basis(normal)
    along_u = load3(points.tangent, i)
    along, across = frame_as_mitsuba(along_u, normal)
    nowhere = (along_u.x == 0.0) & (along_u.y == 0.0) & (along_u.z == 0.0)
    return select3(nowhere, s, along), select3(nowhere, t, across)


@density_normal.by(AsMitsuba)
@kernel
def _density_normal(arithmetic, flat, smooth):
    """Return the normal interpolated from the vertices.

    It makes Mitsuba's smooth mesh lights slightly too bright here and too dark there.
    """
    return smooth


@seen_from.by(AsMitsuba)
@kernel
def _seen_from(arithmetic, points, i):
    """Return the view of a lamp from the exact point that the ray left.

    The ray starts a ray offset away. So it can hit the front of a lamp whose back faces
    the exact point; Mitsuba gives that a density of 0.
    """
    previous = load3(points.previous, i)
    back = previous - load3(points.position, i)
    distance = length(back)
    faces = dot(back, load3(points.shading_normal, i))
    cosine = select(faces > 0.0, faces / distance, np.float32(np.inf))
    return previous, distance, cosine


@near_surface.by(AsMitsuba)
@kernel
def _near_surface(arithmetic):
    return np.float32(arithmetic.ray_epsilon)


@kernel
def _cone(to_center, radius):
    """Return the squared sine and the cosine of half the angle that a sphere subtends."""
    sine = radius * (1.0 / sqrt(squared_length(to_center)))
    sine2 = sine * sine
    return sine2, sqrt(maximum(1.0 - sine2, splat_f32(0.0)))


@cone_of_density.by(AsMitsuba)
@kernel
def _cone_of_density(arithmetic, one_minus_cos, to_center, radius):
    """Return 1 - cos with Mitsuba's loss of digits."""
    _, cosine = _cone(to_center, radius)
    own = exact_cone_of_density(arithmetic, one_minus_cos, to_center, radius)
    return _rounded(1.0 - cosine, own, 1e-6)


@part_of_cone.by(AsMitsuba)
@kernel
def _part_of_cone(arithmetic, x, one_minus_cos, to_center, radius):
    """Return 1 - cos computed from Mitsuba's sine.

    In cones under 1.5 degrees Mitsuba distributes the squared sine uniformly, which is off
    by 1.7e-4 at most; in wider ones the sine comes from a difference, with its rounding.
    """
    sine2_max, cosine = _cone(to_center, radius)
    cosine = fused(cosine - 1.0, x, splat_f32(1.0))
    sine2 = select(sine2_max > _NARROW, 1.0 - cosine * cosine, sine2_max * x)
    part = sine2 / (1.0 + sqrt(maximum(1.0 - sine2, splat_f32(0.0))))
    own = even_part_of_cone(arithmetic, x, one_minus_cos, to_center, radius)
    return _rounded(part, own, 2e-4)


@kernel
def _rounded(theirs, own, share):
    """Return Mitsuba's 1 - cos, or our own if they differ by more than rounding."""
    same = fabs(theirs - own) <= own * np.float32(share) + _LOST
    return select(same, theirs, own)
