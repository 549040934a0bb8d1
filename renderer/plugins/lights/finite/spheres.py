"""Sphere lights: a direction in the cone that the sphere fills; from inside, by area."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import (
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics.mathematics import sincos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import (
    dot,
    gather3,
    normalize,
    orthonormal_basis,
    select3,
)
from renderer.plugins.sampling.arithmetic import Plain
from renderer.plugins.sampling.numbers_and_warps import TWO_PI, square_to_sphere
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.plugins.shapes.surface import LightPoint, pdf_shape, sample_shape


@kernel
def _cone(distance2, radius):
    """Return 1 - cos of the half angle under which a sphere is seen, and its sine squared.

    1 - sqrt(1 - s^2) cancels for a small sphere; s^2 / (1 + sqrt(1 - s^2)) does not.
    """
    sine2 = minimum(radius * radius / distance2, splat_f32(1.0))
    cosine = sqrt(maximum(1.0 - sine2, splat_f32(0.0)))
    return sine2 / (1.0 + cosine), sine2


_TOUCHING = np.float32(1e-7)  # of the radius: least distance to the sphere


@interface
def near_surface(arithmetic: Any) -> Any:
    """Return the distance, over the radius, below which a point is on the sphere."""


@interface
def cone_of_density(
    arithmetic: Any, one_minus_cos: Any, to_center: Any, radius: Any
) -> Any:
    """Return 1 - cos of the half angle of the cone for the density."""


@interface
def part_of_cone(
    arithmetic: Any, x: Any, one_minus_cos: Any, to_center: Any, radius: Any
) -> Any:
    """Return 1 - cos of the angle that has the share x of a cone's solid angle inside."""


@near_surface.by(Plain)
@kernel
def _near_surface(arithmetic):
    return np.float32(5e-6)


@cone_of_density.by(Plain)
@kernel
def exact_cone_of_density(arithmetic, one_minus_cos, to_center, radius):
    """Return `one_minus_cos` unchanged."""
    return one_minus_cos


@part_of_cone.by(Plain)
@kernel
def even_part_of_cone(arithmetic, x, one_minus_cos, to_center, radius):
    """Return the share: the solid angle of a cone is proportional to 1 - cos."""
    return x * one_minus_cos


@kernel
def _outside(arithmetic, distance2, radius, orientation):
    """Return the mask of points that see the sphere from outside.

    Points on the surface count as outside if the sphere emits outwards, and as inside if
    it emits inwards, so that rounding does not decide.
    """
    limit = radius * (1.0 - near_surface(arithmetic) * orientation)
    return distance2 > limit * limit


@kernel
def sphere_light_pdf(
    arithmetic, center, radius, orientation, inverse_area, position, distance, cosine
):
    """Return the density [1/sr] with which `sample_sphere` chooses a direction."""
    to_center = center - position
    distance2 = dot(to_center, to_center)
    one_minus_cos, _ = _cone(distance2, radius)
    one_minus_cos = cone_of_density(arithmetic, one_minus_cos, to_center, radius)
    outside = _outside(arithmetic, distance2, radius, orientation)
    by_area = distance * distance * inverse_area / cosine
    return select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)


@sample_shape.by(SphereSurfaces)
@kernel
def sample_sphere(spheres, kind, light, mask, position, x, y, z):
    """Choose a direction in the cone of the sphere; from inside, a point by area.

    x is the share of the cone's solid angle and y the longitude [Akalin2015]; Mitsuba's
    series for cones under 1.5 degrees differs from it by up to 1.7e-4 of sin^2 theta.
    """
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - spheres.first
    orientation = gather_row(areas.orientation, 0, light, mask)
    center = gather3(spheres.center, index, mask)
    radius = gather_row(spheres.radius, 0, index, mask)
    to_center = center - position
    distance2 = dot(to_center, to_center)
    distance = sqrt(distance2)
    one_minus_cos, sine2_max = _cone(distance2, radius)
    # 1 - cos theta
    small = part_of_cone(kind.arithmetic, x, one_minus_cos, to_center, radius)
    sine2 = small * (2.0 - small)
    sine_theta = sqrt(sine2)
    sine, cosine = sincos(TWO_PI * y)
    # the longitude is counted around the way from the centre to the point that samples
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
    outside = _outside(kind.arithmetic, distance2, radius, orientation)
    to_light = select3(outside, wi * near, to_center + ball * radius)
    n = select3(outside, normalize(cap), ball)
    return LightPoint(to_light, n, n * orientation)


@pdf_shape.by(SphereSurfaces)
@kernel
def _pdf_sphere(spheres, kind, light, prim, mask, position, distance, cosine):
    areas = kind.lights
    index = prim - spheres.first
    return sphere_light_pdf(
        kind.arithmetic,
        gather3(spheres.center, index, mask),
        gather_row(spheres.radius, 0, index, mask),
        gather_row(areas.orientation, 0, light, mask),
        gather_row(areas.inverse_area, 0, light, mask),
        position,
        distance,
        cosine,
    )
