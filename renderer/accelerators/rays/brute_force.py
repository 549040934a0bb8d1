"""Brute force: every primitive against every ray. The truth that the others must return.

Also the fastest for a few dozen primitives, since 16 rays go at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.rays.packets import (
    Nearest,
    begin_packet,
    end_packet,
    intersect_packet,
    nearest_in_order,
)
from renderer.accelerators.rays.query import traverse
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import first_lanes
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3
from renderer.kernels.records.tally import PRIMITIVES, add_to_packet
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup


class BruteForce(NamedTuple):
    """No structure at all."""

    primitives: Any  # a group of one kind, in the scene's order


def build_brute_force(extents: Extents, group: PrimitiveGroup) -> BruteForce:
    """Return all primitives in their order."""
    return BruteForce(group(np.arange(extents.lower.shape[1])))


@traverse.by(BruteForce)
@kernel
def trace_brute_force(accel, query, first, count, tally):
    """Test rays first to first + count - 1, 16 at a time, against all primitives."""
    primitives, end = accel.primitives, accel.primitives.count
    for i in range(first, first + count, 16):
        origin, direction = load3(query.origin, i), load3(query.direction, i)
        left = first + count - i
        if query.any_hit != 0:
            traced = first_lanes(left)
            packet = begin_packet(query, i, traced)
            packet = intersect_packet(
                primitives, 0, end, origin, direction, packet, query.any_hit, tally, i, left
            )
            end_packet(query, i, packet, traced)
            continue
        add_to_packet(tally, PRIMITIVES, i, left, end)
        t, prim = load_row(query.ends, 0, i), load_row(query.prim, 0, i)
        u, v = load_row(query.u, 0, i), load_row(query.v, 0, i)
        nearest = Nearest(t, prim, u, v)
        nearest = nearest_in_order(primitives, 0, end, origin, direction, nearest)
        store_row(query.ends, 0, i, nearest.t)
        store_row(query.prim, 0, i, nearest.prim)
        store_row(query.u, 0, i, nearest.u)
        store_row(query.v, 0, i, nearest.v)
