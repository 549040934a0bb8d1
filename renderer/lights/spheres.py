"""Sphere lights: a direction in the cone that the sphere fills; from inside, by area."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.lanes.functions import (
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.lanes.mathematics import sincos
from renderer.lanes.memory import gather_row
from renderer.sampling import TWO_PI, square_to_sphere
from renderer.vectors import dot, gather3, normalize, orthonormal_basis, select3


@kernel
def is_kind(surfaces, prim, mask):
    """Return where a primitive id is one of a kind's."""
    return mask & (prim >= surfaces.first) & (prim < surfaces.end)


@kernel
def _cone(distance2, radius):
    """Return 1 - cos of the half angle under which a sphere is seen, and its sine squared.

    1 - sqrt(1 - s^2) cancels for a small sphere; s^2 / (1 + sqrt(1 - s^2)) does not.
    """
    sine2 = minimum(radius * radius / distance2, splat_f32(1.0))
    cosine = sqrt(maximum(1.0 - sine2, splat_f32(0.0)))
    return sine2 / (1.0 + cosine), sine2


# Within this of the radius the side that shines decides; Mitsuba has 1500 roundings.
_NEAR_SURFACE = np.float32(5e-6)
_NEAR_SURFACE_OF_MITSUBA = np.float32(1500 * 2.0**-24)
_TOUCHING = np.float32(1e-7)  # of the radius: a light that is touched is still somewhere


@kernel
def _outside(replay, distance2, radius, orientation):
    """Return the mask of points that see the sphere from outside.

    On the surface itself the side that shines decides, not rounding.
    """
    near = _NEAR_SURFACE if replay is None else _NEAR_SURFACE_OF_MITSUBA
    limit = radius * (1.0 - near * orientation)
    return distance2 > limit * limit


@kernel
def _as_mitsuba(replay, one_minus_cos, sine2):
    """Return 1 - cos of the half angle; in a replay with the digits that Mitsuba loses."""
    if replay is None:
        return one_minus_cos
    return 1.0 - sqrt(maximum(1.0 - sine2, splat_f32(0.0)))


@kernel
def sphere_light_pdf(
    replay, center, radius, orientation, inverse_area, position, distance, cosine
):
    """Return the density [1/sr] with which `sample_spheres` chooses a direction."""
    to_center = center - position
    distance2 = dot(to_center, to_center)
    one_minus_cos, sine2 = _cone(distance2, radius)
    one_minus_cos = _as_mitsuba(replay, one_minus_cos, sine2)
    outside = _outside(replay, distance2, radius, orientation)
    by_area = distance * distance * inverse_area / cosine
    return select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)


@kernel
def sample_spheres(
    present, replay, surfaces, prim, mask, orientation, position, x, y, to_light, normal
):
    """Choose a direction in the cone of the sphere; from inside, a point by area.

    x is the share of the cone's solid angle and y the longitude [Akalin2015]; Mitsuba's
    series for cones under 1.5 degrees differs from it by up to 1.7e-4 of sin^2 theta.
    """
    if present is None:
        return to_light, normal
    mine = is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return to_light, normal
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    to_center = center - position
    distance2 = dot(to_center, to_center)
    distance = sqrt(distance2)
    one_minus_cos, sine2_max = _cone(distance2, radius)
    small = x * one_minus_cos  # 1 - cos theta
    sine2 = small * (2.0 - small)
    sine_theta = sqrt(sine2)
    sine, cosine = sincos(TWO_PI * y)
    # the longitude is counted around the way from the centre to the point that asks
    s, t = orthonormal_basis(to_center * (-1.0 / distance))
    wi = s * (sine_theta * cosine) + t * (sine_theta * sine)
    wi = wi + to_center / distance * (1.0 - small)
    # the nearer root as a quotient: as a difference it would be 0 close to the surface
    inner = sqrt(maximum(1.0 - sine2 / sine2_max, splat_f32(0.0)))
    excess = (distance - radius) * (distance + radius)
    near = excess / (distance * (1.0 - small) + radius * inner)
    near = maximum(near, radius * _TOUCHING)
    cap = wi * near - to_center
    ball = square_to_sphere(x, y)
    outside = _outside(replay, distance2, radius, orientation)
    chosen_light = select3(outside, wi * near, to_center + ball * radius)
    n = select3(outside, normalize(cap), ball)
    return select3(mine, chosen_light, to_light), select3(mine, n, normal)


@kernel
def pdf_on_spheres(
    present, areas, surfaces, light, prim, mask, inverse_area, position, r, cosine, pdf
):
    """Return `pdf` with the lanes whose primitive is a sphere replaced."""
    if present is None:
        return pdf
    mine = is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return pdf
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    on_sphere = sphere_light_pdf(
        areas.replay,
        center,
        radius,
        gather_row(areas.orientation, 0, light, mine),
        inverse_area,
        position,
        r,
        cosine,
    )
    return select(mine, on_sphere, pdf)
