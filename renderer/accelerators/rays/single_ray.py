"""What all accelerators do with one ray and some primitives: nearest hit, any hit.

At equal t the smaller id wins, so that no order of visits changes the outcome.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import always_inline, kernel, never_inline
from renderer.kernels.lanes.functions import first_lanes, lane, lowest_bit, mask_bits
from renderer.kernels.records.tally import PRIMITIVES, SAVED, add_to
from renderer.plugins.shapes.primitives import hit_primitive, primitive_at, primitives_from

MAILBOXES = 64  # a power of two


class RayHit(NamedTuple):
    """The nearest hit so far of one ray."""

    t: Any  # the ray's end before the first hit
    prim: Any  # primitive id, -1: none yet
    u: Any
    v: Any


@kernel
def load_hit(query, i):
    """Return the hit of ray i."""
    return RayHit(query.ends[i], query.prim[i], query.u[i], query.v[i])


@kernel
def store_hit(query, i, hit):
    """Store the hit of ray i."""
    query.ends[i] = hit.t
    query.prim[i] = hit.prim
    query.u[i] = hit.u
    query.v[i] = hit.v


@kernel
def nearest_in_range(primitives, start, end, origin, direction, hit, tally, i):
    """Return the nearest hit after primitives start .. end - 1 of a group were tested.

    16 primitives at a time.
    """
    always_inline()  # as a call an octree takes 1.05 times as long
    add_to(tally, PRIMITIVES, i, end - start)
    for k in range(start, end, 16):
        x = hit_primitive(
            primitives, primitives_from(primitives, k), origin, direction, hit.t
        )
        bits = mask_bits(x.hit & first_lanes(end - k))
        while bits != 0:
            j = lowest_bit(bits)
            bits &= bits - 1
            t = lane(x.t, j)
            prim = primitives.id[k + j]
            if t < hit.t or (t == hit.t and (hit.prim < 0 or prim < hit.prim)):
                hit = RayHit(t, prim, lane(x.u, j), lane(x.v, j))
    return hit


@kernel
def nearest_of_all(primitives, origin, direction, hit, tally, i):
    """Return the nearest hit of a ray that is beyond what a structure was built for."""
    never_inline()  # rare: inlined, it would take the registers of the loop around it
    # int64 as elsewhere: for each other type of whole number it would be compiled again
    first, end = np.int64(0), np.int64(primitives.count)
    return nearest_in_range(primitives, first, end, origin, direction, hit, tally, i)


@kernel
def blocked_in_range(primitives, start, end, origin, direction, t_max, tally, i):
    """Return whether one of primitives start .. end - 1 is met up to t_max."""
    for k in range(start, end, 16):
        add_to(tally, PRIMITIVES, i, min(end - k, 16))
        x = hit_primitive(
            primitives, primitives_from(primitives, k), origin, direction, t_max
        )
        if mask_bits(x.hit & first_lanes(end - k)) != 0:
            return True
    return False


@kernel
def hit_in_list(
    primitives, items, start, end, origin, direction, hit, any_will_do, tally, i
):
    """Return the nearest hit after the primitives items[start:end] were tested.

    One at a time: a list names primitives that lie anywhere in the group. If any will do,
    the first hit ends it, or a shadow ray through a BSP tree takes 10 % longer.
    """
    for k in range(start, end):
        add_to(tally, PRIMITIVES, i, 1)
        hit = nearer(primitives, items[k], origin, direction, hit)
        if any_will_do != 0 and hit.prim >= 0:
            break
    return hit


@kernel
def nearer(primitives, k, origin, direction, hit):
    """Return the nearer of `hit` and that of primitive k."""
    x = hit_primitive(primitives, primitive_at(primitives, k), origin, direction, hit.t)
    if x.hit:
        prim = primitives.id[k]
        if x.t < hit.t or hit.prim < 0 or prim < hit.prim:
            return RayHit(x.t, prim, x.u, x.v)
    return hit


@kernel
def clear_mailboxes(mailboxes):
    """Forget what was tested; for the next ray."""
    if mailboxes is None:
        return
    mailboxes[:] = -1


@kernel
def already_tested(mailboxes, k, tally, i):
    """Return whether primitive k was tested lately, and remember that it is now.

    The lecture keeps the last ray's number with each primitive, which only one ray at a
    time can do. Here each ray keeps the last primitives that it met, in `MAILBOXES` places
    by number: what is forgotten is tested once more, to no harm.
    """
    if mailboxes is None:
        return False
    place = k & (MAILBOXES - 1)
    if mailboxes[place] == k:
        add_to(tally, SAVED, i, 1)
        return True
    mailboxes[place] = k
    return False
