"""The rays of a list in the space of an instance, and what they met there.

Two streams stand side by side: the rays in the world, and the guests of an instance, which
are the same rays as they are seen from there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.streams.stream import Stream
from renderer.accelerators.bvh.wide.octants import (
    DIRECTION,
    ENDED,
    ORIGIN,
    T,
    write_rays,
)
from renderer.accelerators.rays.query import Query
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import affine_at, times
from renderer.kernels.lanes.columns import gather_columns
from renderer.kernels.lanes.functions import (
    first_lanes,
    mask_bits,
    popcount,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    scatter_row,
    store_row,
)
from renderer.kernels.lanes.vectors import vec3


class World(NamedTuple):
    """The tree over the instances, and the rays that are in one of them."""

    instances: Any
    guests: Stream  # with lists and stack of the world's stream; `number` counts from 0
    found: Query  # of the guests; its arrays hold what they met in the instance
    host: Any  # (ROW,) int32 of each guest: its place in the world's stream


@kernel
def enter_instance(world, k, stream, place, m, tally):
    """Write the rays of a list as instance k sees them; return how many have not ended."""
    rays, guests, host = stream.rays, world.guests, world.host
    n = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        live &= gather_row(rays.for_boxes, T, ray, live) >= 0.0
        append_row(host, 0, n, ray, live)
        n += popcount(mask_bits(live))
    matrix = affine_at(world.instances.placements.to_object, k)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        ray = load_row(host, 0, i)
        ox, oy, oz, _ = gather_columns(rays.for_leaves, ORIGIN, ray, live)
        dx, dy, dz, _ = gather_columns(rays.for_leaves, DIRECTION, ray, live)
        t = gather_row(rays.for_boxes, T, ray, live)
        origin = times(matrix, vec3(ox, oy, oz) - matrix.at)
        write_rays(guests.rays, i, origin, times(matrix, vec3(dx, dy, dz)), t)
        # none yet, so that equal hits in two instances both come back
        store_row(world.found.prim, 0, i, splat_i32(-1))
        if tally is not None:
            counted = gather_row(stream.counted, 0, ray, live)
            store_row(guests.counted, 0, i, counted)
    return n


@kernel
def leave_instance(world, query, k, rays, n):
    """Keep what the n guests met in instance k where it is the nearest so far.

    Of equal t the smallest primitive id wins, then the smallest instance id.
    """
    inside = world.found
    for i in range(0, n, 16):
        prim = load_row(inside.prim, 0, i)
        found = first_lanes(n - i) & (prim >= 0)
        if mask_bits(found) == 0:
            continue
        ray = load_row(world.host, 0, i)
        number = gather_row(rays.number, 0, ray, found)
        if query.any_hit != 0:
            scatter_row(rays.for_boxes, T, ray, splat_f32(ENDED), found)
            scatter_row(query.prim, 0, number, splat_i32(1), found)
            continue
        t = load_row(inside.ends, 0, i)
        t_before = gather_row(rays.for_boxes, T, ray, found)
        prim_before = gather_row(query.prim, 0, number, found)
        instance_before = gather_row(query.instance, 0, number, found)
        wins = (t < t_before) | (prim_before < 0) | (prim < prim_before)
        wins |= (prim == prim_before) & (instance_before > np.int32(k))
        wins &= found
        scatter_row(rays.for_boxes, T, ray, t, wins)
        scatter_row(query.ends, 0, number, t, wins)
        scatter_row(query.prim, 0, number, prim, wins)
        scatter_row(query.u, 0, number, load_row(inside.u, 0, i), wins)
        scatter_row(query.v, 0, number, load_row(inside.v, 0, i), wins)
        scatter_row(query.instance, 0, number, splat_i32(k), wins)
