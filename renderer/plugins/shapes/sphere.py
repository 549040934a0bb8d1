"""Ray against sphere, in the closed form that does not cancel.

The textbook discriminant b^2 - 4ac loses all digits far away: in single precision every
ray misses a unit sphere at distance 10^4. Measuring the ray's distance to the centre
first, and taking the second root by Vieta's formula, keeps them [Haines2019].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, sqrt
from renderer.kernels.lanes.mathematics.mathematics import arccos
from renderer.kernels.lanes.memory import gather_row, load_eight, load_one, load_row
from renderer.kernels.lanes.vectors import (
    column,
    dot,
    gather3,
    gather_rows3,
    load3,
    normalize,
)
from renderer.plugins.shapes.arrays import float32
from renderer.plugins.shapes.blocks import BLOCKS_OF, column_in, primitives_in, three_in
from renderer.plugins.shapes.flat.patch import ZERO, Intersection
from renderer.plugins.shapes.kind import ShapeKind, flipped
from renderer.plugins.shapes.primitives import hit_primitive, primitive_at, primitives_from
from renderer.plugins.shapes.surface import (
    ROUNDING,
    SurfacePoint,
    around_axis,
    magnitude,
    nowhere,
    surface_point,
    tangent_at,
    turn,
)
from renderer.scene_file import transforms
from renderer.scene_file.description import Sphere as Description
from renderer.scene_file.objects.shapes import STRETCH, placed


class Spheres(NamedTuple):
    """Spheres in the order of an accelerator."""

    center: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


class Sphere(NamedTuple):
    """One sphere, or 16 in lanes."""

    center: Any
    radius: Any


@kernel
def sphere_at(spheres, k):
    """Return sphere k as scalars."""
    return Sphere(column(spheres.center, k), spheres.radius[k])


@kernel
def spheres_from(spheres, k):
    """Return spheres k to k + 15 as lanes."""
    return Sphere(load3(spheres.center, k), load_row(spheres.radius, 0, k))


@kernel
def ordered_roots(q, a, c):
    """Return both roots of a t^2 - 2 b t + c in order, from q = b +- sqrt(b^2 - a c).

    Vieta: their product is c / a, so neither is a difference of nearly equal numbers.
    """
    t_q = q / a
    t_c = c / q
    return select(t_q < t_c, t_q, t_c), select(t_q < t_c, t_c, t_q)


@kernel
def hit_sphere(sphere, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max. u and v are 0: `surface_point` computes them."""
    f = origin - sphere.center
    a = dot(direction, direction)
    b = -dot(f, direction)
    # the point of the line nearest to the centre, relative to it
    nearest = f + direction * (b / a)
    discriminant = sphere.radius * sphere.radius - dot(nearest, nearest)
    root = sqrt(a * select(discriminant > 0.0, discriminant, ZERO * discriminant))
    q = b + select(b < 0.0, -root, root)
    c = dot(f, f) - sphere.radius * sphere.radius
    first, second = ordered_roots(q, a, c)
    t = select(first > 0.0, first, second)
    hit = (discriminant >= 0.0) & (t > 0.0) & (t <= t_max)
    return Intersection(hit, t, t * ZERO, t * ZERO)


# --------------------------------- surface; sampled as a lamp in `lights.finite.spheres`


class SphereSurfaces(NamedTuple):
    """Spheres first .. end - 1 by primitive id."""

    first: int
    end: int
    center: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    frame: NDArray[np.float32]  # (9, n) unit local x, y, z axes in world space


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


@surface_point.by(SphereSurfaces)
@kernel
def _point_on_sphere(spheres, index, mask, u, v, hit_point, with_uv):
    center = gather3(spheres.center, index, mask)
    radius = gather_row(spheres.radius, 0, index, mask)
    normal = normalize(hit_point - center)
    u, v = _polar_uv(spheres.frame, index, mask, normal, with_uv)
    offset = (magnitude(center) + radius) * ROUNDING
    position = center + normal * radius
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, u, v)


tangent_at.by(SphereSurfaces)(around_axis)


# ---------------------------------------------------------------------------- tables


class SphereBlocks(NamedTuple):
    """Centre and radius of eight spheres a block."""

    rows: NDArray[np.float32]  # (blocks, 4 * 8)
    id: NDArray[np.int32]
    count: int


@kernel
def spheres_in(blocks, block):
    """Return the eight spheres of a block as lanes."""
    return Sphere(three_in(blocks.rows, block, 0), load_eight(blocks.rows, block, 24))


@kernel
def sphere_in(blocks, k):
    """Return sphere k as scalars."""
    block, j = k >> 3, k & 7
    return Sphere(column_in(blocks.rows, block, 0, j), load_one(blocks.rows, block, 24 + j))


BLOCKS_OF[Spheres] = SphereBlocks
primitive_at.by(Spheres)(sphere_at)
primitives_from.by(Spheres)(spheres_from)
primitive_at.by(SphereBlocks)(sphere_in)
primitives_in.by(SphereBlocks)(spheres_in)
hit_primitive.by(Spheres, SphereBlocks, drop_first=True)(hit_sphere)


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
        # Mitsuba turns a mirrored sphere inside out, and it alone of the analytic shapes.
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


def _group(s: Any, order: Any, ids: Any, padded: Any) -> Spheres:
    return Spheres(padded(s.center[:, order]), padded(s.radius[order]), ids, len(order))


SPHERES = ShapeKind(
    "spheres",
    Description,
    surfaces,
    flipped,
    _corners,
    _hull,
    _areas,
    _group,
    {"sphere": read},
)
