"""The rays of a batch side by side: those in the world, and those in one instance's space.

A ray is known by its place in the rows. Places from `OBJECT` on are those of the instance
that rays are in at the time: they hold the same rays, seen from there, and what they meet.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh import MARGIN
from renderer.accelerators.bvh.octants import ROW
from renderer.accelerators.bvh.ray_packets import safe_reciprocal
from renderer.accelerators.bvh.stream_leaves import ENDED
from renderer.accelerators.rays.ray_interval import is_finite_ray
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import affine_at, times
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
    select,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    scatter_row,
    store_row,
)
from renderer.kernels.lanes.vectors import gather3, load3, vec3

OBJECT = ROW
ROWS = 2 * ROW


class Rows(NamedTuple):
    """Rays by their place; what they met is of the instance's places alone."""

    # (ROWS,) int32 in the world: of the batch; in an instance: the ray's place in the world
    number: Any
    t: Any  # (ROWS,) float32 where they end; `ENDED`: they are done
    inverse_x: Any  # 1 / direction
    inverse_y: Any
    inverse_z: Any
    start_x: Any  # origin / direction
    start_y: Any
    start_z: Any
    margin: Any  # that boxes are larger by for this ray
    origin_x: Any
    origin_y: Any
    origin_z: Any
    direction_x: Any
    direction_y: Any
    direction_z: Any
    prim: Any  # (ROWS,) int32 primitive id of the nearest hit in the instance, -1: none
    u: Any
    v: Any


@kernel
def empty_rows():
    """Return room for the rays of one batch."""
    return Rows(
        local_i32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
        local_i32(ROWS),
        local_f32(ROWS),
        local_f32(ROWS),
    )


@kernel
def lay_out(query, begin, end, reach, beyond, rows):
    """Write the rays that start within reach, or those beyond it; return how many.

    Rays that are not finite have nothing to find, nor have those that are blocked already.
    """
    n = np.int64(0)
    for i in range(begin, end, 16):
        origin, direction = load3(query.origin, i), load3(query.direction, i)
        distance = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
        near = select(distance <= reach, splat_i32(0), splat_i32(1))
        mine = (near == np.int32(beyond)) & is_finite_ray(origin, direction)
        mine &= first_lanes(end - i)
        if query.any_will_do != 0:
            mine &= load_row(query.prim, 0, i) == 0
        append_row(rows.number, 0, n, lane_index() + np.int32(i), mine)
        n += popcount(mask_bits(mine))
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        number = load_row(rows.number, 0, i)
        origin = gather3(query.origin, number, live)
        direction = gather3(query.direction, number, live)
        t = gather_row(query.ends, 0, number, live)
        _write(rows, i, origin, direction, t)
    return n


@kernel
def _write(rows, i, origin, direction, t):
    """Write 16 rays, and what their box tests need."""
    inverse = safe_reciprocal(direction)
    store_row(rows.t, 0, i, t)
    store_row(rows.inverse_x, 0, i, inverse.x)
    store_row(rows.inverse_y, 0, i, inverse.y)
    store_row(rows.inverse_z, 0, i, inverse.z)
    store_row(rows.start_x, 0, i, origin.x * inverse.x)
    store_row(rows.start_y, 0, i, origin.y * inverse.y)
    store_row(rows.start_z, 0, i, origin.z * inverse.z)
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    store_row(rows.margin, 0, i, far * MARGIN)
    store_row(rows.origin_x, 0, i, origin.x)
    store_row(rows.origin_y, 0, i, origin.y)
    store_row(rows.origin_z, 0, i, origin.z)
    store_row(rows.direction_x, 0, i, direction.x)
    store_row(rows.direction_y, 0, i, direction.y)
    store_row(rows.direction_z, 0, i, direction.z)


@kernel
def rays_at(rows, ray, live):
    """Return origins and directions of the rays at 16 places."""
    origin = vec3(
        gather_row(rows.origin_x, 0, ray, live),
        gather_row(rows.origin_y, 0, ray, live),
        gather_row(rows.origin_z, 0, ray, live),
    )
    direction = vec3(
        gather_row(rows.direction_x, 0, ray, live),
        gather_row(rows.direction_y, 0, ray, live),
        gather_row(rows.direction_z, 0, ray, live),
    )
    return origin, direction


@kernel
def enter_instance(placements, k, rows, lists, place, m):
    """Write the rays of a list as instance k sees them; return how many are not done."""
    n = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        live &= gather_row(rows.t, 0, ray, live) >= 0.0
        append_row(rows.number, 0, OBJECT + n, ray, live)
        n += popcount(mask_bits(live))
    matrix = affine_at(placements.to_object, k)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        ray = load_row(rows.number, 0, OBJECT + i)
        origin, direction = rays_at(rows, ray, live)
        t = gather_row(rows.t, 0, ray, live)
        origin, direction = times(matrix, origin - matrix.at), times(matrix, direction)
        _write(rows, OBJECT + i, origin, direction, t)
        # none yet, so that equal hits in two instances both come back
        store_row(rows.prim, 0, OBJECT + i, splat_i32(-1))
    return n


@kernel
def leave_instance(query, instance, k, rows, n):
    """Keep what the n rays met in instance k where it is the nearest so far.

    Of equal t the smallest primitive id wins, then the smallest instance id.
    """
    for i in range(OBJECT, OBJECT + n, 16):
        live = first_lanes(OBJECT + n - i)
        ray = load_row(rows.number, 0, i)
        t = load_row(rows.t, 0, i)
        number = gather_row(rows.number, 0, ray, live)
        if query.any_will_do != 0:
            met = live & (t < 0.0)
            scatter_row(rows.t, 0, ray, splat_f32(ENDED), met)
            scatter_row(query.prim, 0, number, splat_i32(1), met)
            continue
        prim = load_row(rows.prim, 0, i)
        found = live & (prim >= 0)
        if mask_bits(found) == 0:
            continue
        t_before = gather_row(rows.t, 0, ray, found)
        prim_before = gather_row(query.prim, 0, number, found)
        instance_before = gather_row(instance, 0, number, found)
        wins = (t < t_before) | (prim_before < 0) | (prim < prim_before)
        wins |= (prim == prim_before) & (instance_before > np.int32(k))
        wins &= found
        scatter_row(rows.t, 0, ray, t, wins)
        scatter_row(query.ends, 0, number, t, wins)
        scatter_row(query.prim, 0, number, prim, wins)
        scatter_row(query.u, 0, number, load_row(rows.u, 0, i), wins)
        scatter_row(query.v, 0, number, load_row(rows.v, 0, i), wins)
        scatter_row(instance, 0, number, splat_i32(k), wins)
