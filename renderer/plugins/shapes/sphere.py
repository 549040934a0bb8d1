"""Ray against sphere, in a form without cancellation.

The textbook discriminant b^2 - 4ac loses all digits at large distances: in single
precision every ray misses a unit sphere at distance 10^4. Here the ray's distance to the
centre is computed first, and the second root follows from Vieta's formula [Haines2019].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, interface, kernel
from renderer.kernels.lanes.fields import Number, Vector
from renderer.kernels.lanes.functions import maximum, minimum, select, splat_f32, sqrt
from renderer.kernels.lanes.mathematics import arccos, sincos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import (
    dot,
    gather3,
    gather_rows3,
    normalize,
    orthonormal_basis,
    select3,
    vec3,
)
from renderer.plugins.sampling.numbers_and_warps import (
    TWO_PI,
    FromLastEvent,
    Plain,
    square_to_sphere,
)
from renderer.plugins.shapes.flat import ZERO
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import Intersection, float32
from renderer.plugins.shapes.surface import (
    ROUNDING,
    LightPoint,
    SurfacePoint,
    UvPoint,
    around_axis,
    magnitude,
    nowhere,
    turn,
)
from renderer.scene_file import transforms
from renderer.scene_file.description import Sphere as Description
from renderer.scene_file.objects.objects import STRETCH, placed


class Sphere(NamedTuple):
    """One sphere, or 16 in lanes."""

    center: Vector
    radius: Number


@kernel
def meet_round(f, d, radius):
    """Return the discriminant and both roots in order, where |f + t d| = radius.

    The roots are valid only if the discriminant is not negative. By Vieta's formula their
    product is c / a, so neither is a difference of nearly equal numbers.
    """
    always_inline()
    a = dot(d, d)
    b = -dot(f, d)
    # the point of the ray's line nearest to the centre, relative to the centre
    nearest = f + d * (b / a)
    discriminant = radius * radius - dot(nearest, nearest)
    root = sqrt(a * select(discriminant > 0.0, discriminant, ZERO * discriminant))
    q = b + select(b < 0.0, -root, root)
    c = dot(f, f) - radius * radius
    t_q = q / a
    t_c = c / q
    return discriminant, select(t_q < t_c, t_q, t_c), select(t_q < t_c, t_c, t_q)


@kernel
def hit_sphere(sphere, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max. u and v are 0: `surface_point` computes them."""
    f = origin - sphere.center
    discriminant, first, second = meet_round(f, direction, sphere.radius)
    t = select(first > 0.0, first, second)
    hit = (discriminant >= 0.0) & (t > 0.0) & (t <= t_max)
    return Intersection(hit, t, t * ZERO, t * ZERO)


# ---------------------------------------------------------------------------- surface


class SphereSurfaces(NamedTuple):
    """Spheres first .. end - 1 by primitive id."""

    first: int
    end: int
    center: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    frame: NDArray[np.float32]  # (9, n) unit local x, y, z axes in world space


_PI = np.float32(np.pi)
_INV_PI = np.float32(1.0 / np.pi)


@kernel
def _polar_uv(frame, index, mask, n, with_uv):
    """Return longitude / 2 pi and colatitude / pi of a direction in the local frame."""
    if with_uv == 0:
        return n.x * 0.0, n.x * 0.0
    x = dot(gather_rows3(frame, 0, index, mask), n)
    y = dot(gather_rows3(frame, 3, index, mask), n)
    z = dot(gather_rows3(frame, 6, index, mask), n)
    return turn(x, y), arccos(z) * _INV_PI


@kernel
def _point_on_sphere(spheres, index, mask, u, v, hit_point, with_uv):
    center = gather3(spheres.center, index, mask)
    radius = gather_row(spheres.radius, 0, index, mask)
    normal = normalize(hit_point - center)
    u, v = _polar_uv(spheres.frame, index, mask, normal, with_uv)
    offset = (magnitude(center) + radius) * ROUNDING
    position = center + normal * radius
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, u, v)


@kernel
def _at_uv(spheres, chart, light, prim, orientation, u, v, mask):
    index = prim - spheres.first
    radius = gather_row(spheres.radius, 0, index, mask)
    sine, cosine = sincos(_PI * v)
    n = _around(spheres.frame, index, TWO_PI * u, mask) * sine
    n = n + gather_rows3(spheres.frame, 6, index, mask) * cosine
    position = gather3(spheres.center, index, mask) + n * radius
    area = (TWO_PI * _PI) * radius * radius * sine
    return UvPoint(position, n * orientation, area, mask)


@kernel
def _around(frame, index, angle, mask):
    sine, cosine = sincos(angle)
    x, y = gather_rows3(frame, 0, index, mask), gather_rows3(frame, 3, index, mask)
    return x * cosine + y * sine


@kernel
def _uv_axes(spheres, q, radius):
    down = vec3(q.z * q.x / radius, q.z * q.y / radius, -radius)
    around = vec3(-q.y, q.x, splat_f32(0.0))
    return around * TWO_PI, down * _PI


# ------------- light samples: uniform in the cone of the sphere; from inside, by area


@kernel
def _cone(distance2, radius):
    """Return 1 - cos and sin^2 of half the angle that a sphere subtends.

    1 - sqrt(1 - s^2) cancels for a small sphere; s^2 / (1 + sqrt(1 - s^2)) does not.
    """
    sine2 = minimum(radius * radius / distance2, splat_f32(1.0))
    cosine = sqrt(maximum(1.0 - sine2, splat_f32(0.0)))
    return sine2 / (1.0 + cosine), sine2


_TOUCHING = np.float32(1e-7)  # smallest distance to a light sample, in radii


@interface
def near_surface(arithmetic: Any) -> Any:
    """Return the distance to the surface, in radii, below which `orientation` decides."""


@interface
def cone_of_density(
    arithmetic: Any, one_minus_cos: Any, to_center: Any, radius: Any
) -> Any:
    """Return 1 - cos of the cone's half angle for the pdf."""


@interface
def part_of_cone(
    arithmetic: Any, x: Any, one_minus_cos: Any, to_center: Any, radius: Any
) -> Any:
    """Return 1 - cos theta for the fraction x of the cone's solid angle."""


@near_surface.by(Plain, FromLastEvent)
@kernel
def _near_surface(arithmetic):
    return np.float32(5e-6)


@cone_of_density.by(Plain, FromLastEvent)
@kernel
def exact_cone_of_density(arithmetic, one_minus_cos, to_center, radius):
    """Return `one_minus_cos` unchanged."""
    return one_minus_cos


@part_of_cone.by(Plain, FromLastEvent)
@kernel
def even_part_of_cone(arithmetic, x, one_minus_cos, to_center, radius):
    """Return x (1 - cos): the solid angle of a cone is proportional to 1 - cos."""
    return x * one_minus_cos


@kernel
def _outside(arithmetic, distance2, radius, orientation):
    """Return the mask of points outside of the sphere.

    For a point on the surface the emitting side decides, and not rounding.
    """
    limit = radius * (1.0 - near_surface(arithmetic) * orientation)
    return distance2 > limit * limit


@kernel
def sphere_light_pdf(
    arithmetic, center, radius, orientation, inverse_area, position, distance, cosine
):
    """Return the pdf [1/sr] of the direction for `sample_sphere`."""
    to_center = center - position
    distance2 = dot(to_center, to_center)
    one_minus_cos, _ = _cone(distance2, radius)
    one_minus_cos = cone_of_density(arithmetic, one_minus_cos, to_center, radius)
    outside = _outside(arithmetic, distance2, radius, orientation)
    by_area = distance * distance * inverse_area / cosine
    pdf = select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)
    return select(cosine < np.float32(np.inf), pdf, 0.0)  # in a replay: seen from behind


@kernel
def sample_sphere(spheres, kind, light, mask, position, x, y, z):
    """Sample a direction in the cone of the sphere; from inside, a point by area.

    x is the fraction of the cone's solid angle and y the azimuth [Akalin2015]. For cones
    under 1.5 degrees Mitsuba uses a series, which differs by up to 1.7e-4 of sin^2 theta.
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
    # the azimuth is around the direction from the centre to the receiving point
    s, t = orthonormal_basis(to_center * (-1.0 / distance))
    wi = s * (sine_theta * cosine) + t * (sine_theta * sine)
    wi = wi + to_center / distance * (1.0 - small)
    # the nearer root as a quotient: as a difference it would be 0 near the surface
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


# ---------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Description:
    """Read the properties of a file."""
    center = properties.vector("center", (0.0, 0.0, 0.0))
    radius = properties.number("radius", 1.0, above=0.0)
    to_world = properties.transform("to_world")
    lengths = transforms.column_lengths(to_world)
    if transforms.has_shear(to_world) or np.ptp(lengths) > STRETCH * lengths.max():
        properties.fail(
            "to_world",
            "a transform that makes an ellipsoid",
            "a rotation, translation and uniform scale",
        )
    flip = properties.boolean("flip_normals", False)
    local = transforms.translate(*center) @ transforms.scale(radius, radius, radius)
    return Description(
        **common,
        to_world=placed(properties, to_world @ local),
        # Mitsuba turns a mirrored sphere inside out, but no other analytic shape.
        flip_normals=flip != transforms.mirrors(to_world),
    )


def surfaces(shapes: list[Description], first: int) -> SphereSurfaces:
    """Return the surfaces of shapes with primitive ids from `first` on."""
    matrices = np.array([shape.to_world for shape in shapes])
    scale = np.linalg.norm(matrices[:, :3, 0], axis=1)
    frame = matrices[:, :3, :3] / scale[:, None, None]  # columns are the local axes
    return SphereSurfaces(
        first,
        first + len(shapes),
        float32(matrices[:, :3, 3].T),
        float32(scale),
        float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )


def _corners(s: Any) -> list[NDArray[np.float32]]:
    return [s.center - s.radius, s.center + s.radius]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    points = np.repeat(s.center[:, None, order], 4, axis=1)
    return points, s.radius[order], np.zeros((3, len(order)), np.float32)


def _areas(s: Any, k: Any) -> NDArray[np.float64]:
    return 4.0 * np.pi * s.radius[k].astype(np.float64) ** 2


SPHERES = ShapeKind(
    name="spheres",
    plugins={"sphere": read},
    description=Description,
    record=SphereSurfaces,
    surfaces=surfaces,
    primitive=Sphere,
    intersect=hit_sphere,
    surface_point=_point_on_sphere,
    tangent=around_axis,
    sample=sample_sphere,
    pdf=_pdf_sphere,
    point_at_uv=_at_uv,
    uv_axes=_uv_axes,
    corners=_corners,
    hull=_hull,
    areas=_areas,
)
