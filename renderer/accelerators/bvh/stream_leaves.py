"""What the rays of a list meet in a leaf: 16 rays at a time, each primitive in turn."""

from __future__ import annotations

import numpy as np

from renderer.accelerators.rays.packets import Nearest, blocked_by, nearest_of
from renderer.jit import kernel
from renderer.kinds.shapes.blocks import WIDTH
from renderer.lanes.functions import (
    first_lanes,
    mask_bits,
    popcount,
    select,
    splat_i32,
    splat_mask,
)
from renderer.lanes.memory import gather_row, load_eight, load_row, scatter_row
from renderer.lanes.vectors import gather3

ENDED = np.float32(-1.0)  # the end of a ray that enters nothing more


@kernel
def meet_leaf(blocks, block, rays, hits, blocked, rows, lists, place, m):
    """Test each 16 rays of a list against one primitive of a leaf after the other."""
    start = WIDTH * block
    end = start + held(blocks, block)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        number = gather_row(rows.number, 0, ray, live)
        origin = gather3(rays.origin, number, live)
        direction = gather3(rays.direction, number, live)
        t = select(live, gather_row(rows.t, 0, ray, live), ENDED)
        nearer, t = _meet_nearest(blocks, start, end, origin, direction, t, hits, number)
        shut = _meet_any(blocks, start, end, origin, direction, t, blocked, number)
        met = (nearer | shut) & live
        if mask_bits(met) != 0:
            scatter_row(rows.t, 0, ray, select(shut, ENDED, t), met)


@kernel
def held(blocks, block):
    """Return how many primitives a block holds."""
    return popcount(mask_bits(load_eight(blocks.id, 0, WIDTH * block) >= 0))


@kernel
def _meet_nearest(blocks, start, end, origin, direction, t, hits, number):
    """Update the hits of 16 rays; return for which, and where these end now."""
    if hits is None:
        return splat_mask(False), t
    live = t >= 0.0
    prim = gather_row(hits.prim, 0, number, live)
    before = Nearest(t, prim, t, t)  # u and v as good as any: no hit yet
    zero = np.int64(0)
    found = nearest_of(blocks, start, end, origin, direction, before, None, zero, zero)
    nearer = live & (found.prim != prim)
    if mask_bits(nearer) != 0:  # seldom, and scattering nothing takes as long as something
        scatter_row(hits.t, 0, number, found.t, nearer)
        scatter_row(hits.prim, 0, number, found.prim, nearer)
        scatter_row(hits.u, 0, number, found.u, nearer)
        scatter_row(hits.v, 0, number, found.v, nearer)
    return nearer, found.t


@kernel
def _meet_any(blocks, start, end, origin, direction, t, blocked, number):
    """Set `blocked` of those of 16 rays that meet something; return which they are."""
    if blocked is None:
        return splat_mask(False)
    ended = ~(t >= 0.0)
    zero = np.int64(0)
    met = blocked_by(blocks, start, end, origin, direction, t, ended, None, zero, zero)
    met &= ~ended
    if mask_bits(met) != 0:
        scatter_row(blocked, 0, number, splat_i32(1), met)
    return met
