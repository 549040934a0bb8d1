"""A query: rays, the kind of hit to find, and the arrays of the results.

Every structure implements `traverse` once, for nearest hit and any hit. Both kinds of query
have the same type, so Numba types a traversal once. `any_hit` is a constant in each method
that calls it (`accelerators.dispatch`), so LLVM removes the branches of the other kind.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel


class Query(NamedTuple):
    """Rays and the arrays of their results."""

    origin: Any  # (3, n) float32
    direction: Any  # (3, n) float32
    ends: Any  # (n,) float32 t_max; of a nearest hit, its t
    prim: Any  # (n,) int32 primitive id of the nearest hit; for any hit, 1 if blocked
    u: Any  # (n,) float32 of the nearest hit
    v: Any
    instance: Any  # (n,) int32 of the nearest hit
    any_hit: int  # nonzero: any hit ends and blocks a ray


@kernel
def nearest_hits(rays, hits):
    """Return the query for the nearest hit of each ray."""
    return Query(
        rays.origin,
        rays.direction,
        hits.t,
        hits.prim,
        hits.u,
        hits.v,
        hits.instance,
        np.int64(0),
    )


@kernel
def any_hits(shadow_rays):
    """Return the query for occlusion of each ray."""
    ends, blocked = shadow_rays.t_max, shadow_rays.blocked
    return Query(
        shadow_rays.origin,
        shadow_rays.direction,
        ends,
        blocked,
        ends,
        ends,
        blocked,
        np.int64(1),
    )


@interface
def traverse(accel, query, first, count, tally):
    """Answer a query for rays first to first + count - 1."""


@interface
def traverse_coherent(accel, query, first, count, tally):
    """Answer a query as `traverse` does, faster for coherent rays."""
