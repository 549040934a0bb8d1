"""A shape of one's own, which its file alone describes: the ellipsoid, a mapped ball.

Any affine map is allowed. It cannot be a lamp and has no texture coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

import renderer
from renderer.kernels.lanes.fields import Vector
from renderer.kernels.lanes.functions import select
from renderer.kernels.lanes.vectors import dot, gather3, normalize, vec3
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import Intersection
from renderer.plugins.shapes.sphere import meet_round
from renderer.plugins.shapes.surface import ROUNDING, SurfacePoint, magnitude, nowhere
from renderer.scene_file.description import Shape


@dataclass(frozen=True, eq=False, kw_only=True)
class Description(Shape):
    """The unit ball around the origin of its own space."""

    to_world: np.ndarray  # (4, 4)
    flip_normals: bool = False


class Ellipsoid(NamedTuple):
    """What an accelerator holds: the map into the space where it is the unit ball."""

    center: Vector
    x: Vector  # rows of the inverse
    y: Vector
    z: Vector


class Ellipsoids(NamedTuple):
    """All ellipsoids of a scene, (3, n) each."""

    first: int
    end: int
    center: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    axis_x: np.ndarray  # where the local axes are in the world
    axis_y: np.ndarray
    axis_z: np.ndarray


def surfaces(shapes, first):
    maps = np.array([shape.to_world for shape in shapes])
    linear = maps[:, :3, :3]
    parts = [maps[:, :3, 3], *np.linalg.inv(linear).swapaxes(0, 1)]
    parts += [linear[:, :, k] for k in range(3)]
    columns = (np.ascontiguousarray(part.T, np.float32) for part in parts)
    return Ellipsoids(first, first + len(shapes), *columns)


@renderer.kernel
def to_ball(x, y, z, a):
    """Return a vector in the space where the ellipsoid is a ball."""
    return vec3(dot(x, a), dot(y, a), dot(z, a))


@renderer.kernel
def intersect(e, origin, direction, t_max):
    """Intersect with the unit ball: t means the same in both spaces."""
    f = to_ball(e.x, e.y, e.z, origin - e.center)
    d = to_ball(e.x, e.y, e.z, direction)
    discriminant, first, second = meet_round(f, d, np.float32(1.0))
    t = select(first > 0.0, first, second)
    hit = (discriminant >= 0.0) & (t > 0.0) & (t <= t_max)
    return Intersection(hit, t, t * np.float32(0.0), t * np.float32(0.0))


@renderer.kernel
def surface_point(table, index, mask, u, v, hit_point, with_uv):
    """Return the point of the ball in the direction of the hit, mapped to the world."""
    center = gather3(table.center, index, mask)
    x = gather3(table.x, index, mask)
    y = gather3(table.y, index, mask)
    z = gather3(table.z, index, mask)
    n = normalize(to_ball(x, y, z, hit_point - center))
    out = gather3(table.axis_x, index, mask) * n.x
    out = out + gather3(table.axis_y, index, mask) * n.y
    out = out + gather3(table.axis_z, index, mask) * n.z
    normal = normalize(x * n.x + y * n.y + z * n.z)
    offset = (magnitude(center) + magnitude(out)) * ROUNDING
    return SurfacePoint(center + out, normal, normal, nowhere(mask), offset, u, v)


@renderer.kernel
def tangent(table, index, mask, u, v, normal):
    """Return 0: there is no u."""
    return normal * 0.0


def half_sizes(table):
    return np.sqrt(table.axis_x**2 + table.axis_y**2 + table.axis_z**2)


def corners(table):
    return [table.center - half_sizes(table), table.center + half_sizes(table)]


def hull(table, columns):
    center = np.repeat(table.center[:, None, columns], 4, axis=1)
    radius = np.linalg.norm(half_sizes(table)[:, columns], axis=0)
    return center, radius, np.zeros((3, len(columns)), np.float32)


def read(properties: Any, common: dict[str, Any]) -> Description:
    return Description(
        **common,
        to_world=properties.transform("to_world"),
        flip_normals=properties.boolean("flip_normals", False),
    )


ELLIPSOIDS = ShapeKind(
    name="ellipsoids",
    plugins={"ellipsoid": read},
    description=Description,
    record=Ellipsoids,
    surfaces=surfaces,
    primitive=Ellipsoid,
    intersect=intersect,
    surface_point=surface_point,
    tangent=tangent,
    corners=corners,
    hull=hull,
)
