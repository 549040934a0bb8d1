"""Code shared by flat shapes: plane, patch, intersection and surface point."""

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
# Triangle, parallelogram and disk differ only in the test of (u, v). Either the patch or
# the ray may be in lanes: one primitive for 16 rays, or 16 primitives for one ray.

# A Python literal would make scalars float64, which round differently from the lanes.
ONE = np.float32(1.0)
ZERO = np.float32(0.0)
# Rays at less than about this angle [rad] to a plane are decided in double precision. The
# rounding error of t and (u, v) grows as 1 / angle, without a bound. In single precision
# brute force reported hits far outside of the primitive, and accelerators, which test
# boxes, disagreed with it (278 of 5.6 million grazing rays; now none).
GRAZING = np.float32(0.125)
# A grazing ray is decided again if single precision puts it inside, or outside by at most
# this in u and v: rounding may have moved it across an edge.
MARGIN = np.float32(-0.125)


class Patch(NamedTuple):
    """One flat primitive, or 16 in lanes: the points corner + u edge1 + v edge2."""

    corner: Vector
    edge1: Vector
    edge2: Vector
    normal: Vector  # edge1 x edge2, not normalised
    breadth: Derived  # |x| + |y| + |z| of the normal


class PlaneHit(NamedTuple):
    """t, u, v of a ray in a plane, times `scale` >= 0: the division comes later."""

    scale: Any
    t: Any
    u: Any
    v: Any


@kernel
def meet_plane(patch, origin, direction):
    """Intersect with the plane of a patch and solve for (u, v).

    The lecture's steps: t = n . (c - p) / n . d, then c + u e1 + v e2 = p + t d. The cross
    product of the second equation with d eliminates t: with r = (c - p) x d,
    u = e2 . r / n . d and v = -e1 . r / n . d. If the ray is parallel to the plane, n . d
    (`scale`) is 0, and the callers' tests reject it.
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
    """Return t, u, v and scale with the sign changed where `slope` is negative."""
    return PlaneHit(
        fabs(slope),
        negate_by_sign(t, slope),
        negate_by_sign(u, slope),
        negate_by_sign(v, slope),
    )


@kernel
def _breadth(normal, stored):
    """Return |x| + |y| + |z|; groups store it, blocks have it computed here."""
    if stored is None:
        return fabs(normal.x) + fabs(normal.y) + fabs(normal.z)
    return stored


@kernel
def grazing(patch, plane_hit, direction):
    """Return the mask of rays that graze the plane in front of their origin.

    Their rounding error has no bound. Those that pass near the patch are intersected again
    by `meet_plane_in_double`. The mask must not depend on t_max, the nearest hit so far:
    t_max depends on the order of visits, so two accelerators would decide the same hit in
    different precisions.
    """
    d = direction
    longest = GRAZING * (fabs(d.x) + fabs(d.y) + fabs(d.z))  # |d| is not 1 in instances
    breadth = _breadth(patch.normal, patch.breadth)
    return (plane_hit.scale < longest * breadth) & (plane_hit.t > 0.0)


@kernel
def in_double(a):
    """Return a vector in double precision."""
    return vec3(to_double(a.x), to_double(a.y), to_double(a.z))


@kernel
def meet_plane_in_double(patch, origin, direction, doubtful, single):
    """Return `meet_plane` in double precision where `doubtful`, elsewhere `single`."""
    never_inline()  # inlined, packets of camera rays are a quarter slower
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
    """Return the hit mask `inside` and 0 < t <= t_max and t finite, with t, u, v.

    t is compared after the division, as everywhere else. Otherwise which of two
    primitives at equal t is reported could depend on the order of visits.
    """
    inverse = ONE / plane_hit.scale
    t = plane_hit.t * inverse
    hit = inside & (t > 0.0) & (t <= t_max) & (plane_hit.scale > 0.0)
    hit &= t < np.float32(np.inf)  # t overflows for a triangle of size 1e-20
    return Intersection(hit, t, plane_hit.u * inverse, plane_hit.v * inverse)


# --------------------------------------------------------------------------------- flat
# Tables of triangles, rectangles and disks share these: a corner and two edges.

# Parts of the table `places`, three rows each: all that a point of a flat shape needs.
PARTS = ("corner", "edge1", "edge2", "normal")

Record = TypeVar("Record")


def with_parts(record: type[Record]) -> type[Record]:
    """Add to a record with `places` each part, (3, n), as a property."""
    for k, name in enumerate(PARTS):
        rows = slice(3 * k, 3 * k + 3)
        setattr(record, name, property(lambda surfaces, rows=rows: surfaces.places[rows]))
    return record


@with_parts
class FlatSurfaces(NamedTuple):
    """Flat shapes with primitive ids first .. end - 1; base class of their records."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2


def flat_surfaces(record: Any, first: int, corner: Any, x: Any, y: Any) -> Any:
    """Return the record of flat shapes from corners and edges, (n, 3) each."""
    return record(first, first + len(corner), places(corner.T, x.T, y.T))


def places(corner: Any, edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return the table (12, n) of corners, edges and unit normals, from (3, n) each."""
    return by_columns(np.concatenate([corner, edge1, edge2, unit_normals(edge1, edge2)]))


def replaced(surfaces: Any, **parts: Any) -> Any:
    """Return a copy of a record with other `corner`, `edge1`, ..., (3, n) each."""
    rows = [parts.get(name, getattr(surfaces, name)) for name in PARTS]
    return surfaces._replace(places=by_columns(np.concatenate(rows)))


def placed_axes(shapes: list[Any]) -> tuple[Any, Any, Any]:
    """Return the local x and y axes and the centres of shapes in world space, (n, 3)."""
    matrices = np.array([shape.to_world for shape in shapes])
    return matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 3]


def orientation(shape: Any) -> float:
    """Return -1 if the normal (the transformed +z) is opposite to edge1 x edge2, else 1."""
    return -1.0 if mirrors(shape.to_world) != shape.flip_normals else 1.0


def hull(corners: tuple[tuple[float, float], ...]) -> Callable[[Any, Any], Any]:
    """Return a function that computes hulls of the points corner + u edge1 + v edge2."""

    def of(s: Any, order: Any) -> tuple[Any, Any, Any]:
        c, e1, e2 = (a[:, order] for a in (s.corner, s.edge1, s.edge2))
        placed = [c + np.float32(u) * e1 + np.float32(v) * e2 for u, v in corners]
        return np.stack(placed, 1), np.zeros(len(order), np.float32), unit_normals(e1, e2)

    return of


def areas(factor: float) -> Callable[[Any, Any], NDArray[np.float64]]:
    """Return a function that computes areas: `factor` times that of the parallelogram."""

    def of(s: Any, k: Any) -> NDArray[np.float64]:
        a, b = (edges[:, k].T.astype(np.float64) for edges in (s.edge1, s.edge2))
        return factor * np.linalg.norm(np.cross(a, b), axis=1)

    return of


def numbers(s: Any, columns: Any) -> tuple[Any, ...]:
    """Return the fields of `Patch`."""
    edge1, edge2 = s.edge1[:, columns], s.edge2[:, columns]
    normal = np.cross(edge1.T.astype(np.float64), edge2.T.astype(np.float64)).T
    normal = normal.astype(np.float32)
    x, y, z = np.abs(normal)
    return s.corner[:, columns], edge1, edge2, normal, x + y + z
