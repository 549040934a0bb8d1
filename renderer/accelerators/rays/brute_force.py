"""Brute force: every primitive against every ray. The truth that the others must return.

Also the fastest for a few dozen primitives, since 16 rays go at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.rays.packets import (
    blocked_by,
    load_nearest,
    nearest_in_order,
    store_nearest,
)
from renderer.kernels.jit import method_kernel
from renderer.kernels.lanes.functions import first_lanes, select, splat_i32
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


@method_kernel
def closest_hit_brute_force(accel, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1 with nearer hits."""
    primitives = accel.primitives
    for i in range(first, first + count, 16):
        origin = load3(rays.origin, i)
        direction = load3(rays.direction, i)
        before = load_nearest(hits, i)
        add_to_packet(tally, PRIMITIVES, i, first + count - i, primitives.count)
        nearest = nearest_in_order(
            primitives, 0, primitives.count, origin, direction, before
        )
        store_nearest(hits, i, nearest)


@method_kernel
def any_hit_brute_force(accel, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays that meet a primitive before t_max."""
    primitives = accel.primitives
    for i in range(0, count, 16):
        origin = load3(shadow_rays.origin, i)
        direction = load3(shadow_rays.direction, i)
        t_max = load_row(shadow_rays.t_max, 0, i)
        blocked = (load_row(shadow_rays.blocked, 0, i) != 0) | ~first_lanes(count - i)
        blocked = blocked_by(
            primitives,
            0,
            primitives.count,
            origin,
            direction,
            t_max,
            blocked,
            tally,
            i,
            count - i,
        )
        store_row(shadow_rays.blocked, 0, i, select(blocked, splat_i32(1), splat_i32(0)))
