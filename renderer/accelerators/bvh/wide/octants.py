"""Rays by the octant of their direction: for those of one, near and far are the same sides.

They are laid out again with what box tests need, to go down a tree together
(`ray_streams`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.rays.box_entry import MARGIN, safe_reciprocal
from renderer.accelerators.rays.ray_interval import is_finite_ray
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.columns import store_columns
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    largest,
    mask_bits,
    maximum,
    popcount,
    select,
    splat_f32,
    splat_i32,
    splat_mask,
)
from renderer.kernels.lanes.memory import append_row, gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import gather3, load3

STREAM = 1024  # rays that go together at most
ROW = STREAM + 32
AFAR = 8  # in place of an octant: origins whose rounding would spoil the boxes of others
_NOBODY = 9  # and rays that have no answer to find
T = 3  # the row of `for_boxes` that says where rays end
ENDED = np.float32(-1.0)  # the end of a ray that enters nothing more


class Octant(NamedTuple):
    """The rays of one octant, side by side; first the octants of a whole batch."""

    octant: Any  # (ROW,) int32 of each ray of the batch
    number: Any  # (ROW,) int32 in the batch
    # both (8, ROW) float32, column by column: a ray's numbers are side by side
    for_boxes: Any  # 1 / direction, where it ends; origin / direction, and one unused
    for_leaves: Any  # origin and one unused, direction and one unused


@kernel
def write_octants(query, begin, end, few, near, rows):
    """Note the octant of each direction; 0 for all where they will not go together.

    Rays from where |x| + |y| + |z| is more than `near` are `AFAR`.
    """
    one, none = splat_i32(1), splat_i32(0)
    for i in range(begin, end, 16):
        d = load3(query.direction, i)
        octant = (
            select(d.x < 0.0, one, none)
            | select(d.y < 0.0, one << 1, none)
            | select(d.z < 0.0, one << 2, none)
        )
        origin = load3(query.origin, i)
        far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z) > near
        octant = none if few else select(far, AFAR, octant)
        asked = is_finite_ray(origin, d) & ~_shut(query, i)
        store_row(rows.octant, 0, i - begin, select(asked, octant, _NOBODY))


@kernel
def _shut(query, i):
    """Return which of 16 rays are blocked already."""
    if query.any_hit == 0:
        return splat_mask(False)
    return load_row(query.prim, 0, i) != 0


@kernel
def select_octant(begin, end, octant, rows):
    """List the numbers of the rays of an octant; return how many there are."""
    n = np.int64(0)
    for i in range(0, end - begin, 16):
        mine = load_row(rows.octant, 0, i) == np.int32(octant)
        mine &= first_lanes(end - begin - i)
        append_row(rows.number, 0, n, lane_index() + np.int32(begin + i), mine)
        n += popcount(mask_bits(mine))
    return n


@kernel
def lay_out(query, rows, n):
    """Write what the box tests of n rays need; return the margin.

    It is the largest of the rays' `origin_margins`. Boxes are made larger by it once, where
    the margin of each ray would be three numbers more to gather.
    """
    margin = splat_f32(0.0)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        number = load_row(rows.number, 0, i)
        o, d = gather3(query.origin, number, live), gather3(query.direction, number, live)
        t, r = gather_row(query.ends, 0, number, live), safe_reciprocal(d)
        store_columns(rows.for_boxes, 0, i, r.x, r.y, r.z, t)
        store_columns(rows.for_boxes, 4, i, o.x * r.x, o.y * r.y, o.z * r.z, t)
        store_columns(rows.for_leaves, 0, i, o.x, o.y, o.z, t)
        store_columns(rows.for_leaves, 4, i, d.x, d.y, d.z, t)
        far = fabs(o.x) + fabs(o.y) + fabs(o.z)
        margin = maximum(margin, far * MARGIN)
    return largest(margin)
