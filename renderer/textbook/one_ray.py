"""A ray, its nearest hit so far, and the loops that trace rays through a structure.

At equal distance the primitive with the smaller id wins. So the result does not depend on
the order of visits, and every structure returns the same bits as brute force.

A structure of cells lists each primitive wherever its grown box or hull reaches. The growth
covers the rounding of rays that start within `reach` of the world's origin. Rays from
farther away, and rays with a direction so long or short that products would leave the range
of single precision, are tested against all primitives.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import fabs
from renderer.kernels.lanes.vectors import column
from renderer.kernels.records.batch import PRIMITIVES, SAVED, add_to
from renderer.plugins.shapes.primitives import hit_primitive, primitive_at

MAILBOXES = 64  # a power of two
_SHORTEST, _LONGEST = np.float32(1e-15), np.float32(1e15)  # |x| + |y| + |z| of directions
# `reach` is a rounded sum of coordinates: a camera that starts there must be within it.
_ROUNDED = np.float32(1.000001)
_INFINITY = np.float32(np.inf)


class Ray(NamedTuple):
    """The points origin + t direction, t >= 0."""

    origin: Any  # vector of float32
    direction: Any  # vector of float32, of any length
    inverse: Any  # 1 / direction; infinite along an axis that the ray is perpendicular to


class RayHit(NamedTuple):
    """The nearest hit so far."""

    t: Any  # t_max before the first hit
    prim: Any  # primitive id, -1 for none yet
    u: Any
    v: Any


@interface
def trace_ray(structure, ray, hit, any_hit, tally, i):
    """Return the nearest hit of a ray, or the first hit found if `any_hit` is not 0.

    Parameters
    ----------
    structure
        The record of a structure, whose class selects the implementation.
    ray : Ray
        Finite, with a nonzero direction, from within `structure.reach`.
    hit : RayHit
        The hit so far.
    any_hit : int64
        A number, not a literal: Numba types a traversal once for both kinds of query, and
        LLVM knows the value in each.
    tally, i
        Counters of the work, or None; the index of the ray.
    """


@kernel
def trace_ray_by_ray(structure, query, first, count, tally):
    """Answer a query (`accelerators.rays.query`) for rays first to first + count - 1."""
    any_hit, zero = query.any_hit, np.float32(0.0)
    for i in range(first, first + count):
        if any_hit != 0 and query.prim[i] != 0:
            continue
        origin, direction = column(query.origin, i), column(query.direction, i)
        hit = RayHit(query.ends[i], np.int32(-1), zero, zero)
        if any_hit == 0:
            hit = RayHit(query.ends[i], query.prim[i], query.u[i], query.v[i])
        hit = _hit_of(structure, origin, direction, hit, any_hit, tally, i)
        if any_hit == 0:
            query.ends[i], query.prim[i] = hit.t, hit.prim
            query.u[i], query.v[i] = hit.u, hit.v
        elif hit.prim >= 0:
            query.prim[i] = 1


@kernel
def _hit_of(structure, origin, direction, hit, any_hit, tally, i):
    """Return the hit of any ray; a ray with NaN, infinity or direction 0 hits nothing."""
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    length = fabs(direction.x) + fabs(direction.y) + fabs(direction.z)
    if not (far < _INFINITY and np.float32(0.0) < length < _INFINITY):
        return hit
    ray = Ray(origin, direction, np.float32(1.0) / direction)
    if far <= structure.reach * _ROUNDED and _SHORTEST < length < _LONGEST:
        return trace_ray(structure, ray, hit, any_hit, tally, i)
    for k in range(structure.primitives.count):
        hit = test_primitive(structure.primitives, k, ray, hit, tally, i)
        if any_hit != 0 and hit.prim >= 0:
            break
    return hit


# ---------------------------------------------------------------------- primitive tests


@kernel
def test_items(structure, begin, end, ray, hit, any_hit, tally, i):
    """Return the nearest hit after testing the primitives items[begin:end]."""
    for k in range(begin, end):
        hit = test_primitive(structure.primitives, structure.items[k], ray, hit, tally, i)
        if any_hit != 0 and hit.prim >= 0:
            break
    return hit


@kernel
def test_primitive(primitives, k, ray, hit, tally, i):
    """Return the nearer of `hit` and the ray's hit of primitive k of a group."""
    add_to(tally, PRIMITIVES, i, 1)
    primitive = primitive_at(primitives, k)
    x = hit_primitive(primitives, primitive, ray.origin, ray.direction, hit.t)
    if x.hit:
        prim = primitives.id[k]
        if x.t < hit.t or hit.prim < 0 or prim < hit.prim:
            return RayHit(x.t, prim, x.u, x.v)
    return hit


@kernel
def interval_in_box(box, ray, t_max):
    """Return (enter, leave) of a ray in a box (6,), within 0 to t_max.

    The ray hits the box if enter <= leave. A ray in a face gives 0 * inf = NaN, which fails
    both comparisons of `_between`, so it counts as inside.
    """
    o, inverse = ray.origin, ray.inverse
    enter, leave = _between(box[0], box[3], o.x, inverse.x, np.float32(0.0), t_max)
    enter, leave = _between(box[1], box[4], o.y, inverse.y, enter, leave)
    return _between(box[2], box[5], o.z, inverse.z, enter, leave)


@kernel
def _between(low, high, start, inverse, enter, leave):
    """Return the part of an interval that is between two planes."""
    a = (low - start) * inverse
    b = (high - start) * inverse
    if inverse < 0.0:
        a, b = b, a
    return (a if a > enter else enter), (b if b < leave else leave)


# ---------------------------------------------------------------------------- mailboxes


@kernel
def clear_mailboxes(mailboxes):
    """Clear the mailboxes for the next ray."""
    if mailboxes is None:
        return
    mailboxes[:] = -1


@kernel
def already_tested(mailboxes, k, tally, i):
    """Return whether item k was tested recently, and record the test.

    A ray remembers its last items, in `MAILBOXES` places by item number. If overwritten, it
    is tested again, which changes no hit. If `mailboxes` is None, every item counts as new.
    """
    if mailboxes is None:
        return False
    place = k & (MAILBOXES - 1)
    if mailboxes[place] == k:
        add_to(tally, SAVED, i, 1)
        return True
    mailboxes[place] = k
    return False
