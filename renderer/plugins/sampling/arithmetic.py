"""Interfaces for operations on directions and densities whose rounding can be replaced.

The renderer uses the plain formulas (`Plain`). A replay, which must agree with Mitsuba to
the last bit, passes the kernels another record, for which it implements the interfaces.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import fabs
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import (
    cross,
    dot,
    load3,
    normalize,
    orthonormal_basis,
    select3,
    vec3,
)
from renderer.plugins.sampling.numbers_and_warps import square_to_cosine_hemisphere


class Plain(NamedTuple):
    """The formulas as they stand."""


class AlongU(NamedTuple):
    """The same, with the x axis of the local frame along dp/du."""


def along_u(arithmetic: Any) -> Any:
    """Return the arithmetic for BSDFs that are not the same in all directions around z."""
    return AlongU() if isinstance(arithmetic, Plain) else arithmetic


class Frame(NamedTuple):
    """The local coordinates of a surface point: unit vectors, the normal is z."""

    s: Any
    t: Any
    n: Any


@interface
def cosine_direction(arithmetic: Any, x: Any, y: Any) -> Any:
    """Map [0, 1)^2 to unit vectors around +z with density cos / pi."""


@interface
def to_world(arithmetic: Any, frame: Frame, local: Any) -> Any:
    """Return the direction in the world that has components `local` in a frame."""


@interface
def tangents_of(arithmetic: Any, points: Any, i: int, normal: Any) -> Any:
    """Return two unit vectors across the shading normals of points i to i + 15.

    They belong to the surface, not to the side that is seen.
    """


@interface
def density_normal(arithmetic: Any, flat: Any, smooth: Any) -> Any:
    """Return the normal whose cosine turns a density per area into one per solid angle.

    Of the geometric normal and that between a mesh's vertices.
    """


@interface
def seen_from(arithmetic: Any, points: Any, i: int) -> Any:
    """Return the point before on the path, the distance to it, and the |cosine| here."""


@kernel
def to_local(frame, direction):
    """Return the components of a direction in a frame."""
    return vec3(dot(direction, frame.s), dot(direction, frame.t), dot(direction, frame.n))


@cosine_direction.by(Plain, AlongU)
@kernel
def _cosine_direction(arithmetic, x, y):
    return square_to_cosine_hemisphere(x, y)


@to_world.by(Plain, AlongU)
@kernel
def _to_world(arithmetic, frame, local):
    return frame.s * local.x + frame.t * local.y + frame.n * local.z


@tangents_of.by(Plain)
@kernel
def _tangents_of(arithmetic, points, i, normal):
    return orthonormal_basis(normal)


@tangents_of.by(AlongU)
@kernel
def _tangents_along_u(arithmetic, points, i, normal):
    along_u = load3(points.tangent, i)
    across = along_u - normal * dot(normal, along_u)
    nowhere = ~(dot(across, across) > 0.0)  # at a pole, or where u does not change
    s, t = orthonormal_basis(normal)
    across = normalize(select3(nowhere, s, across))
    return across, select3(nowhere, t, cross(normal, across))


@density_normal.by(Plain)
@kernel
def _density_normal(arithmetic, flat, smooth):
    """Return the one that the area belongs to."""
    return flat


@seen_from.by(Plain)
@kernel
def _seen_from(arithmetic, points, i):
    """Go back along the ray: exact up to the offset of its origin."""
    wo, t = load3(points.wo, i), load_row(points.t, 0, i)
    here = load3(points.position, i)
    return here + wo * t, t, fabs(dot(wo, load3(points.normal, i)))
