"""Surface interfaces that every kind of shape implements, and code for flat shapes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import fabs, maximum, select
from renderer.kernels.lanes.mathematics import arctan2
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.kernels.lanes.vectors import dot, gather_rows3, vec3
from renderer.plugins.sampling.numbers_and_warps import TWO_PI

# Rounding error of a position on a primitive, relative to its coordinates.
ROUNDING = np.float32(2.0**-24)
_INV_TWO_PI = np.float32(0.5 / np.pi)


class SurfacePoint(NamedTuple):
    """A surface point in 16 lanes, in the object's space."""

    position: Any
    normal: Any  # geometric, unit, before the shape's orientation
    shading_normal: Any  # unit; final where `smooth`
    smooth: Any  # mask: the shading normal comes from vertex normals
    offset: Any  # rounding error of the position
    u: Any
    v: Any


class LightPoint(NamedTuple):
    """Sampled points of area lights, for 16 receiving points."""

    to_light: Any  # vector from the receiving points
    normal: Any  # for the conversion from area to solid angle
    side: Any  # unit normal of the emitting side


class UvPoint(NamedTuple):
    """A point of a shape in 16 lanes, given by its (u, v)."""

    position: Any  # in the world
    side: Any  # unit normal of the emitting side
    area: Any  # |dp/du x dp/dv|: a pdf by (u, v) over this is the pdf by area
    found: Any  # mask: the shape has a point with this (u, v)


@interface
def surface_point(
    surfaces: Any, index: Any, mask: Any, u: Any, v: Any, hit_point: Any, with_uv: int
) -> SurfacePoint:
    """Return the surface points of hits.

    Positions are computed from the primitive (corner + u edge1 + v edge2, centre + r n),
    not as p + t d. So their error does not grow with the distance to the ray's origin.

    Parameters
    ----------
    index
        Columns of the record.
    u, v
        Coordinates (u, v) of the hits on their primitives.
    hit_point
        p + t d, used by curved kinds.
    with_uv
        0 if the scene does not use texture coordinates.
    """


@interface
def tangent_at(surfaces: Any, index: Any, mask: Any, u: Any, v: Any, normal: Any) -> Any:
    """Return dp/du, not normalised; `normal` points away from the axis or the centre."""


@interface
def sample_shape(
    surfaces: Any, kind: Any, light: Any, mask: Any, position: Any, x: Any, y: Any, z: Any
) -> LightPoint:
    """Sample a point of area lights; `kind` is their `LightKind`."""


@interface
def pdf_shape(
    surfaces: Any,
    kind: Any,
    light: Any,
    prim: Any,
    mask: Any,
    position: Any,
    distance: Any,
    cosine: Any,
) -> Any:
    """Return the pdf [1/sr] of an area light's samples for a given direction.

    Parameters
    ----------
    light, prim
        Ids of the light, and of the primitive that was hit.
    position
        The receiving point.
    distance, cosine
        Distance to the light, and |cosine| at the light.
    """


@interface
def point_at_uv(
    surfaces: Any,
    chart: Any,
    light: Any,
    prim: Any,
    orientation: Any,
    u: Any,
    v: Any,
    mask: Any,
) -> UvPoint:
    """Return the points of area lights at (u, v), for sampling textured radiance.

    Parameters
    ----------
    chart
        For meshes: which triangles cover each (u, v), a `UvChart`.
    prim
        The primitive, if the light has only one.
    orientation
        -1 if the outward normal is flipped, else 1.
    """


@kernel
def magnitude(a):
    """Return the largest absolute component."""
    return maximum(maximum(fabs(a.x), fabs(a.y)), fabs(a.z))


@kernel
def turn(x, y):
    """Return the angle of (x, y) as a fraction of a turn in [0, 1)."""
    angle = arctan2(y, x)
    return select(angle < 0.0, angle + TWO_PI, angle) * _INV_TWO_PI


class Flat(NamedTuple):
    """Flat primitives: the points corner + u edge1 + v edge2."""

    corner: Any
    edge1: Any
    edge2: Any
    normal: Any  # unit


@kernel
def gather_flat(surfaces, index, mask):
    """Return flat primitives in lanes."""
    a = gather_columns(surfaces.places, 0, index, mask)
    b = gather_columns(surfaces.places, 4, index, mask)
    c = gather_columns(surfaces.places, 8, index, mask)
    return Flat(
        vec3(a[0], a[1], a[2]),
        vec3(a[3], b[0], b[1]),
        vec3(b[2], b[3], c[0]),
        vec3(c[1], c[2], c[3]),
    )


@kernel
def flat_point(surfaces, index, mask, u, v):
    """Return position, normal and rounding error on flat primitives."""
    p = gather_flat(surfaces, index, mask)
    position = p.corner + p.edge1 * u + p.edge2 * v
    size = magnitude(p.corner) + magnitude(p.edge1) + magnitude(p.edge2)
    return position, p.normal, size * ROUNDING


@kernel
def flat_light_point(surfaces, kind, light, mask, position, u, v):
    """Return the points at (u, v) of flat area lights of one primitive each."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - surfaces.first
    p = gather_flat(surfaces, index, mask)
    point = p.corner + p.edge1 * u + p.edge2 * v
    side = p.normal * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, p.normal, side)


@kernel
def around_axis(curved, index, mask, u, v, normal):
    """Return the tangent around the local z axis (u is the angle); 0 at a pole."""
    x_axis = gather_rows3(curved.frame, 0, index, mask)
    y_axis = gather_rows3(curved.frame, 3, index, mask)
    return y_axis * dot(x_axis, normal) - x_axis * dot(y_axis, normal)


@kernel
def nowhere(mask):
    """Return a mask without set lanes."""
    return mask & ~mask


@kernel
def pdf_by_area(surfaces, kind, light, prim, mask, position, distance, cosine):
    """Return the pdf [1/sr] of points sampled uniformly by area; see `pdf_shape`."""
    inverse_area = gather_row(kind.lights.inverse_area, 0, light, mask)
    return distance * distance * inverse_area / cosine
