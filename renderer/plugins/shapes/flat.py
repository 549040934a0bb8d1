"""What flat shapes have in common: plane, patch, hit and point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel, never_inline
from renderer.kernels.lanes.fields import Derived, Vector
from renderer.kernels.lanes.functions import (
    fabs,
    negate_by_sign,
    select,
    to_double,
    to_single,
)
from renderer.kernels.lanes.vectors import cross, dot, vec3
from renderer.plugins.shapes.primitives import Intersection, mirrors, unit_normals

# -------------------------------------------------------------------------------- patch
# Flat primitives: a corner, two edges, and the plane they span.
#
# Triangle, parallelogram and disk differ only in which (u, v) are inside. Vectors may be
# of scalars or lanes on either side: one primitive for 16 rays, or 16 primitives for one
# ray.

# A Python literal would make scalars float64, and round differently from the lanes.
ONE = np.float32(1.0)
ZERO = np.float32(0.0)
# Rays at less than about this angle [rad] to a plane are decided in double precision. The
# rounding of t and (u, v) grows with 1 / angle, without a bound: brute force in single
# precision reported hits far outside of the primitive, and accelerators, which go by
# boxes, disagreed with it (278 of 5.6 million awkward rays; now none).
GRAZING = np.float32(0.125)
# A grazing ray is decided again if single precision puts it inside, or outside by no more
# than this in u and v: rounding may have taken it over an edge.
MARGIN = np.float32(-0.125)


class Patch(NamedTuple):
    """One flat primitive, or 16 in lanes: the points corner + u edge1 + v edge2."""

    corner: Vector
    edge1: Vector
    edge2: Vector
    normal: Vector  # edge1 x edge2, not normalised
    breadth: Derived  # |x| + |y| + |z| of the normal


class PlaneHit(NamedTuple):
    """t, u, v of a ray in a plane, multiplied by `scale` >= 0 to put off the division."""

    scale: Any
    t: Any
    u: Any
    v: Any


@kernel
def meet_plane(patch, origin, direction):
    """Intersect with the plane of a patch and solve for (u, v).

    The lecture's steps: t = n . (c - p) / n . d, then c + u e1 + v e2 = p + t d. Crossing
    the second equation with d removes t: with r = (c - p) x d, u = e2 . r / n . d and
    v = -e1 . r / n . d. For a ray parallel to the
    plane n . d (`scale`) is 0, and the tests of the caller reject it.
    """
    to_corner = patch.corner - origin
    r = cross(to_corner, direction)
    return _upright(
        dot(patch.normal, direction),
        dot(patch.normal, to_corner),
        dot(patch.edge2, r),
        -dot(patch.edge1, r),
    )


@kernel
def _upright(slope, t, u, v):
    """Return t, u, v over a scale that is not negative."""
    return PlaneHit(
        fabs(slope),
        negate_by_sign(t, slope),
        negate_by_sign(u, slope),
        negate_by_sign(v, slope),
    )


@kernel
def _breadth(normal, stored):
    """Return |x| + |y| + |z|, which groups store and blocks do not."""
    if stored is None:
        return fabs(normal.x) + fabs(normal.y) + fabs(normal.z)
    return stored


@kernel
def grazing(patch, plane_hit, direction):
    """Return which rays graze the plane in front of them: there rounding has no bound.

    Those of them that come near the patch take the steps again (`meet_plane_in_double`).
    t_max must have no say in which: it is the nearest hit so far, that depends on the order
    of visits, and two accelerators would decide one hit in two precisions.
    """
    d = direction
    longest = GRAZING * (fabs(d.x) + fabs(d.y) + fabs(d.z))  # 1 in the world, not in groups
    breadth = _breadth(patch.normal, patch.breadth)
    return (plane_hit.scale < longest * breadth) & (plane_hit.t > 0.0)


@kernel
def in_double(a):
    """Return a vector in double precision."""
    return vec3(to_double(a.x), to_double(a.y), to_double(a.z))


@kernel
def meet_plane_in_double(patch, origin, direction, doubtful, single):
    """Return what `meet_plane` does, in double precision where `doubtful`."""
    never_inline()  # or bundles of camera rays are a quarter slower
    edge1, edge2 = in_double(patch.edge1), in_double(patch.edge2)
    d = in_double(direction)
    to_corner = in_double(patch.corner) - in_double(origin)
    normal = cross(edge1, edge2)
    r = cross(to_corner, d)
    p = _upright(
        to_single(dot(normal, d)),
        to_single(dot(normal, to_corner)),
        to_single(dot(edge2, r)),
        to_single(-dot(edge1, r)),
    )
    return PlaneHit(
        select(doubtful, p.scale, single.scale),
        select(doubtful, p.t, single.t),
        select(doubtful, p.u, single.u),
        select(doubtful, p.v, single.v),
    )


@kernel
def divided(plane_hit, inside, t_max):
    """Return the intersection where `inside`, 0 < t <= t_max and t is finite.

    t is compared after the division, as every other comparison of t is: otherwise two
    primitives at equal t could win in one order of visits and lose in another.
    """
    inverse = ONE / plane_hit.scale
    t = plane_hit.t * inverse
    hit = inside & (t > 0.0) & (t <= t_max) & (plane_hit.scale > 0.0)
    hit &= t < np.float32(np.inf)  # a triangle of 1e-20 may be met there
    return Intersection(hit, t, plane_hit.u * inverse, plane_hit.v * inverse)


# --------------------------------------------------------------------------------- flat
# What the tables of triangles, rectangles and disks share: a corner and two edges.

# The parts of a table of `places`, three rows each: what a point of a flat shape needs.
PARTS = ("corner", "edge1", "edge2", "normal")

Record = TypeVar("Record")


def with_parts(record: type[Record]) -> type[Record]:
    """Give a record that has `places` each of their parts, (3, n), as an attribute."""
    for k, name in enumerate(PARTS):
        rows = slice(3 * k, 3 * k + 3)
        setattr(record, name, property(lambda surfaces, rows=rows: surfaces.places[rows]))
    return record


@with_parts
class FlatSurfaces(NamedTuple):
    """Flat shapes first .. end - 1 by primitive id; their classes derive from this one."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2


def flat_surfaces(record: Any, first: int, corner: Any, x: Any, y: Any) -> Any:
    """Return the record of flat shapes from rows (n, 3) of corners and edges."""
    return record(first, first + len(corner), places(corner.T, x.T, y.T))


def places(corner: Any, edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return the table (12, n) of corners, edges and unit normals, from (3, n) each."""
    return by_columns(np.concatenate([corner, edge1, edge2, unit_normals(edge1, edge2)]))


def replaced(surfaces: Any, **parts: Any) -> Any:
    """Return a record of flat shapes with other `corner`, `edge1`, ..., (3, n)."""
    rows = [parts.get(name, getattr(surfaces, name)) for name in PARTS]
    return surfaces._replace(places=by_columns(np.concatenate(rows)))


def placed_axes(shapes: list[Any]) -> tuple[Any, Any, Any]:
    """Return the local x and y axes and the centres of shapes in the world, (n, 3)."""
    matrices = np.array([shape.to_world for shape in shapes])
    return matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 3]


def orientation(shape: Any) -> float:
    """Return -1 where the normal, the transformed +z, is opposite to edge1 x edge2."""
    return -1.0 if mirrors(shape.to_world) != shape.flip_normals else 1.0


def hull(corners: tuple[tuple[float, float], ...]) -> Callable[[Any, Any], Any]:
    """Return what makes hulls of the points corner + u edge1 + v edge2: flat, no radius."""

    def of(s: Any, order: Any) -> tuple[Any, Any, Any]:
        c, e1, e2 = (a[:, order] for a in (s.corner, s.edge1, s.edge2))
        placed = [c + np.float32(u) * e1 + np.float32(v) * e2 for u, v in corners]
        return np.stack(placed, 1), np.zeros(len(order), np.float32), unit_normals(e1, e2)

    return of


def areas(factor: float) -> Callable[[Any, Any], NDArray[np.float64]]:
    """Return what gives areas: so many times that of the parallelogram."""

    def of(s: Any, k: Any) -> NDArray[np.float64]:
        a, b = (edges[:, k].T.astype(np.float64) for edges in (s.edge1, s.edge2))
        return factor * np.linalg.norm(np.cross(a, b), axis=1)

    return of


def numbers(s: Any, columns: Any) -> tuple[Any, ...]:
    """Return the fields of `patch.Patch`."""
    edge1, edge2 = s.edge1[:, columns], s.edge2[:, columns]
    normal = np.cross(edge1.T.astype(np.float64), edge2.T.astype(np.float64)).T
    normal = normal.astype(np.float32)
    x, y, z = np.abs(normal)
    return s.corner[:, columns], edge1, edge2, normal, x + y + z
