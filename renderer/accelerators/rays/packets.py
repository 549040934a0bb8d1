"""Nearest-hit and any-hit tests of 16 rays against some primitives, for all structures."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import always_inline, kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    as_u32,
    joined,
    lower_half,
    mask_bits,
    select,
    splat_i32,
    splat_mask,
    upper_half,
)
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.memory import load_one, load_row, store_row
from renderer.kernels.lanes.vectors import lower_half3, upper_half3
from renderer.kernels.records.batch import PRIMITIVES, add_to_packet
from renderer.plugins.shapes.primitives import Intersection, hit_primitive, primitive_at


class Nearest(NamedTuple):
    """The nearest hits of 16 rays so far."""

    t: Any  # t_max before the first hit
    prim: Any  # primitive id, -1 for none yet
    u: Any
    v: Any


class Packet(NamedTuple):
    """The hits of 16 rays so far."""

    nearest: Nearest
    blocked: Any  # mask of the rays blocked by any hit; empty for nearest-hit queries


@kernel
def begin_packet(query, i, traced):
    """Return the packet of rays i to i + 15; rays not in `traced` get an empty interval."""
    t = select(traced, load_row(query.ends, 0, i), -1.0)
    prim = load_row(query.prim, 0, i)
    blocked = splat_mask(False)
    if query.any_hit != 0:
        blocked = (prim != 0) | ~traced
    return Packet(Nearest(t, prim, t, t), blocked)  # any u and v: no hit yet


@kernel
def end_packet(query, i, packet, traced):
    """Store the hits of rays i to i + 15."""
    before = load_row(query.prim, 0, i)
    if query.any_hit != 0:
        met = (before != 0) | (packet.blocked & traced)
        store_row(query.prim, 0, i, select(met, splat_i32(1), splat_i32(0)))
        return
    nearest = packet.nearest
    found = nearest.prim != before
    if mask_bits(found) == 0:
        return  # do not touch arrays that are not in the cache
    store_row(query.ends, 0, i, select(found, nearest.t, load_row(query.ends, 0, i)))
    store_row(query.prim, 0, i, nearest.prim)
    store_row(query.u, 0, i, select(found, nearest.u, load_row(query.u, 0, i)))
    store_row(query.v, 0, i, select(found, nearest.v, load_row(query.v, 0, i)))


@kernel
def hit_packet(primitives, k, origin, direction, t_max):
    """Intersect 16 rays with primitive k of a group.

    On AVX2 it is done in two halves of eight: a triangle test of 16 rays needs twice its 16
    registers.
    """
    always_inline()
    primitive = primitive_at(primitives, k)
    if not HAS_AVX2_ONLY:
        return hit_primitive(primitives, primitive, origin, direction, t_max)
    o, d = lower_half3(origin), lower_half3(direction)
    a = hit_primitive(primitives, primitive, o, d, lower_half(t_max))
    o, d = upper_half3(origin), upper_half3(direction)
    b = hit_primitive(primitives, primitive, o, d, upper_half(t_max))
    return Intersection(
        joined(a.hit, b.hit), joined(a.t, b.t), joined(a.u, b.u), joined(a.v, b.v)
    )


@kernel
def nearest_of(primitives, start, end, origin, direction, nearest, tally, i, count):
    """Return the nearest hits after testing primitives start .. end - 1 of a group.

    At equal t the smaller id wins, so the result does not depend on the order of visits.
    The tally counts for `count` rays from i on.
    """
    add_to_packet(tally, PRIMITIVES, i, count, end - start)
    for k in range(start, end):
        x = hit_packet(primitives, k, origin, direction, nearest.t)
        prim = load_one(primitives.id, 0, k)
        # as unsigned, -1 is the largest id
        tie = (x.t == nearest.t) & (as_u32(nearest.prim) > np.uint32(prim))
        wins = x.hit & ((x.t < nearest.t) | tie)
        nearest = Nearest(
            select(wins, x.t, nearest.t),
            select(wins, splat_i32(prim), nearest.prim),
            select(wins, x.u, nearest.u),
            select(wins, x.v, nearest.v),
        )
    return nearest


@kernel
def nearest_in_order(primitives, start, end, origin, direction, before):
    """Do as `nearest_of`, for primitives whose ids grow from start to end - 1.

    The previous hit's primitive must have none of these ids, nor one between them. Then no
    tie occurs among these primitives; against the previous hit they all win or all lose a
    tie. If they win, t_max becomes the next larger float. Hits must be nearer than t_max.
    """
    # as unsigned, -1 (no hit yet) is the largest id
    wins_ties = as_u32(before.prim) > np.uint32(load_one(primitives.id, 0, start))
    wins_ties &= before.t < np.float32(np.inf)
    t = select(wins_ties, as_f32(as_i32(before.t) + 1), before.t)
    prim, u, v = before.prim, before.u, before.v
    for k in range(start, end):
        x = hit_packet(primitives, k, origin, direction, t)
        wins = x.hit & (x.t < t)
        t = select(wins, x.t, t)
        prim = select(wins, splat_i32(load_one(primitives.id, 0, k)), prim)
        u = select(wins, x.u, u)
        v = select(wins, x.v, v)
    return Nearest(select(prim == before.prim, before.t, t), prim, u, v)


@kernel
def blocked_by(primitives, start, end, origin, direction, t_max, blocked, tally, i, count):
    """Return `blocked`, set also for rays that hit one of primitives start .. end - 1.

    `nearest_of` gives the same but takes 1.09 times as long: it has no early exit when all
    rays are blocked.
    """
    for k in range(start, end):
        add_to_packet(tally, PRIMITIVES, i, count, 1)
        x = hit_packet(primitives, k, origin, direction, t_max)
        blocked = blocked | x.hit
        if mask_bits(blocked) == 0xFFFF:
            break
    return blocked


@kernel
def intersect_packet(
    primitives, start, end, origin, direction, packet, any_hit, tally, i, count
):
    """Return the hits of 16 rays after testing primitives start .. end - 1."""
    nearest, blocked = packet.nearest, packet.blocked
    if any_hit != 0:
        blocked = blocked_by(
            primitives, start, end, origin, direction, nearest.t, blocked, tally, i, count
        )
    else:
        nearest = nearest_of(
            primitives, start, end, origin, direction, nearest, tally, i, count
        )
    return Packet(nearest, blocked)
