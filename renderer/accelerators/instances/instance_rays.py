"""The rays of a batch side by side: those in the world, and those in one instance's space.

A ray is known by its place in the rows. Places from `OBJECT` on are those of the instance
that rays are in at the time: they hold the same rays, seen from there, and what they meet.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.wide.octants import ENDED, ROW
from renderer.accelerators.rays.box_entry import MARGIN as BOX_MARGIN
from renderer.accelerators.rays.box_entry import safe_reciprocal
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
from renderer.kernels.lanes.local import local_rows_f32, local_rows_i32
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    scatter_row,
    store_row,
)
from renderer.kernels.lanes.vectors import gather3, gather_rows3, load3

# Lists of no more rays than this are tested ray by ray, eight children or eight primitives
# at a time; with AVX2 all are in leaves.
SHORT = 8
OBJECT = ROW  # the first place of an instance's rays
PLACES = 2 * ROW
# rows of floats
T = 0  # where a ray ends; `ENDED`: it is done
INVERSE = 1  # 3 rows: 1 / direction
START = 4  # 3 rows: origin / direction
MARGIN = 7  # that boxes are larger by for this ray
ORIGIN = 8  # 3 rows
DIRECTION = 11  # 3 rows
U = 14  # of the nearest hit in the instance
V = 15
# rows of integers
NUMBER = 0  # in the world: of the batch; in an instance: the ray's place in the world
PRIM = 1  # primitive id of the nearest hit in the instance, -1: none


class Rows(NamedTuple):
    """Rays by their place."""

    floats: Any  # (16, PLACES) float32
    integers: Any  # (2, PLACES) int32


@kernel
def empty_rows():
    """Return room for the rays of one batch."""
    return Rows(local_rows_f32(16, PLACES), local_rows_i32(2, PLACES))


@kernel
def lay_out(query, begin, end, reach, beyond, rows):
    """Write the rays that start within reach, or those beyond it; return how many.

    Rays that are not finite have nothing to find, nor have those that are blocked already.
    """
    n = np.int64(0)
    for i in range(begin, end, 16):
        origin, direction = load3(query.origin, i), load3(query.direction, i)
        distance = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
        side = select(distance <= reach, splat_i32(0), splat_i32(1))
        mine = (side == np.int32(beyond)) & is_finite_ray(origin, direction)
        mine &= first_lanes(end - i)
        if query.any_hit != 0:
            mine &= load_row(query.prim, 0, i) == 0
        append_row(rows.integers, NUMBER, n, lane_index() + np.int32(i), mine)
        n += popcount(mask_bits(mine))
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        number = load_row(rows.integers, NUMBER, i)
        origin = gather3(query.origin, number, live)
        direction = gather3(query.direction, number, live)
        t = gather_row(query.ends, 0, number, live)
        _write(rows, i, origin, direction, t)
    return n


@kernel
def _write(rows, i, origin, direction, t):
    """Write 16 rays, and what their box tests need."""
    inverse = safe_reciprocal(direction)
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    store_row(rows.floats, T, i, t)
    _store3(rows.floats, INVERSE, i, inverse)
    _store3(rows.floats, START, i, origin * inverse)
    store_row(rows.floats, MARGIN, i, far * BOX_MARGIN)
    _store3(rows.floats, ORIGIN, i, origin)
    _store3(rows.floats, DIRECTION, i, direction)


@kernel
def _store3(floats, row, i, a):
    store_row(floats, row, i, a.x)
    store_row(floats, row + 1, i, a.y)
    store_row(floats, row + 2, i, a.z)


@kernel
def enter_instance(placements, k, rows, lists, place, m):
    """Write the rays of a list as instance k sees them; return how many are not done."""
    n = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        live &= gather_row(rows.floats, T, ray, live) >= 0.0
        append_row(rows.integers, NUMBER, OBJECT + n, ray, live)
        n += popcount(mask_bits(live))
    matrix = affine_at(placements.to_object, k)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        ray = load_row(rows.integers, NUMBER, OBJECT + i)
        origin = gather_rows3(rows.floats, ORIGIN, ray, live)
        direction = gather_rows3(rows.floats, DIRECTION, ray, live)
        t = gather_row(rows.floats, T, ray, live)
        origin, direction = times(matrix, origin - matrix.at), times(matrix, direction)
        _write(rows, OBJECT + i, origin, direction, t)
        # none yet, so that equal hits in two instances both come back
        store_row(rows.integers, PRIM, OBJECT + i, splat_i32(-1))
    return n


@kernel
def leave_instance(query, k, rows, n):
    """Keep what the n rays met in instance k where it is the nearest so far.

    Of equal t the smallest primitive id wins, then the smallest instance id.
    """
    for i in range(OBJECT, OBJECT + n, 16):
        live = first_lanes(OBJECT + n - i)
        ray = load_row(rows.integers, NUMBER, i)
        t = load_row(rows.floats, T, i)
        number = gather_row(rows.integers, NUMBER, ray, live)
        if query.any_hit != 0:
            met = live & (t < 0.0)
            scatter_row(rows.floats, T, ray, splat_f32(ENDED), met)
            scatter_row(query.prim, 0, number, splat_i32(1), met)
            continue
        prim = load_row(rows.integers, PRIM, i)
        found = live & (prim >= 0)
        if mask_bits(found) == 0:
            continue
        t_before = gather_row(rows.floats, T, ray, found)
        prim_before = gather_row(query.prim, 0, number, found)
        instance_before = gather_row(query.instance, 0, number, found)
        wins = (t < t_before) | (prim_before < 0) | (prim < prim_before)
        wins |= (prim == prim_before) & (instance_before > np.int32(k))
        wins &= found
        scatter_row(rows.floats, T, ray, t, wins)
        scatter_row(query.ends, 0, number, t, wins)
        scatter_row(query.prim, 0, number, prim, wins)
        scatter_row(query.u, 0, number, load_row(rows.floats, U, i), wins)
        scatter_row(query.v, 0, number, load_row(rows.floats, V, i), wins)
        scatter_row(query.instance, 0, number, splat_i32(k), wins)
