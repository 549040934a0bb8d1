"""Brute force: every primitive against every ray. The truth that the others must return.

Also the fastest for a few dozen primitives, since 16 rays go at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.jit import kernel
from renderer.lanes.functions import first_lanes, mask_bits, select, splat_i32
from renderer.lanes.memory import load_row, store_row
from renderer.shapes.primitives import hit_primitive, primitive_at
from renderer.vectors import load3


class BruteForce(NamedTuple):
    """No structure at all."""

    primitives: Any  # a group of one kind, in the scene's order


def build_brute_force(primitives: Any) -> BruteForce:
    """Return the group as it is."""
    return BruteForce(primitives)


@kernel
def closest_hit_brute_force(accel, rays, hits, first, count):
    """Update `hits` of rays first to first + count - 1 with nearer hits.

    At equal t the smaller primitive id wins, in every accelerator.
    """
    primitives = accel.primitives
    n = primitives.count
    for i in range(first, first + count, 16):
        origin = load3(rays.origin, i)
        direction = load3(rays.direction, i)
        t = load_row(hits.t, 0, i)
        prim = load_row(hits.prim, 0, i)
        u = load_row(hits.u, 0, i)
        v = load_row(hits.v, 0, i)
        for k in range(n):
            x = hit_primitive(primitives, primitive_at(primitives, k), origin, direction, t)
            id_k = primitives.id[k]
            nearer = x.hit & ((x.t < t) | ((x.t == t) & ((prim < 0) | (prim > id_k))))
            t = select(nearer, x.t, t)
            prim = select(nearer, splat_i32(id_k), prim)
            u = select(nearer, x.u, u)
            v = select(nearer, x.v, v)
        store_row(hits.t, 0, i, t)
        store_row(hits.prim, 0, i, prim)
        store_row(hits.u, 0, i, u)
        store_row(hits.v, 0, i, v)


@kernel
def any_hit_brute_force(accel, shadow_rays, count):
    """Set `blocked` of the first `count` shadow rays that meet a primitive before t_max."""
    primitives = accel.primitives
    n = primitives.count
    for i in range(0, count, 16):
        origin = load3(shadow_rays.origin, i)
        direction = load3(shadow_rays.direction, i)
        t_max = load_row(shadow_rays.t_max, 0, i)
        blocked = (load_row(shadow_rays.blocked, 0, i) != 0) | ~first_lanes(count - i)
        for k in range(n):
            x = hit_primitive(
                primitives, primitive_at(primitives, k), origin, direction, t_max
            )
            blocked = blocked | x.hit
            if mask_bits(blocked) == 0xFFFF:
                break
        store_row(shadow_rays.blocked, 0, i, select(blocked, splat_i32(1), splat_i32(0)))
