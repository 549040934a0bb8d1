"""The rays of a stream: select them by octant, and store them as box tests need them.

For rays with directions in one octant, the near and far planes of boxes are the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.rays.box_entry import MARGIN as BOX_MARGIN
from renderer.accelerators.rays.box_entry import safe_reciprocal
from renderer.accelerators.rays.single_ray import is_finite_ray
from renderer.kernels.jit import kernel
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
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    store_columns,
    store_row,
)
from renderer.kernels.lanes.vectors import gather3, load3

# Rays in a stream. 4096 are 1.05 to 1.2 times as fast as 1024 in trees of 100,000 to a
# million triangles; those of one octant fit into the first cache.
STREAM = 4096
ROW = STREAM + 32
AFAR = 8  # instead of an octant: origins so far that their margin would inflate all boxes
_NOT_TRACED = 9  # rays that cannot hit: not finite, or blocked already
ENDED = np.float32(-1.0)  # t_max of a ray that enters no more boxes
# rows of `StreamRays.for_boxes`
INVERSE = 0  # 3 rows: 1 / direction
T = 3  # t_max
START = 4  # 3 rows: origin / direction
MARGIN = 7  # padding of boxes for this ray
# rows of `StreamRays.for_leaves`
ORIGIN = 0  # 3 rows, and one unused
DIRECTION = 4  # 3 rows, and one unused


class StreamRays(NamedTuple):
    """The rays of a stream, each stored contiguously."""

    number: Any  # (ROW,) int32 column of each ray in the query's arrays
    # both (8, ROW) float32 in column order: the numbers of a ray are contiguous
    for_boxes: Any
    for_leaves: Any


@kernel
def write_octants(query, begin, end, near, divided, octants):
    """Write the octant of each direction; 0 for all unless `divided`.

    Rays that start where |x| + |y| + |z| exceeds `near` get `AFAR`.
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
        octant = select(far, AFAR, octant if divided else none)
        traced = is_finite_ray(origin, d) & ~_blocked(query, i)
        store_row(octants, 0, i - begin, select(traced, octant, _NOT_TRACED))


@kernel
def _blocked(query, i):
    """Return the mask of those of 16 rays that are blocked already."""
    if query.any_hit == 0:
        return splat_mask(False)
    return load_row(query.prim, 0, i) != 0


@kernel
def select_octant(begin, end, octant, octants, rays):
    """List the numbers of the rays of an octant; return how many there are."""
    n = np.int64(0)
    for i in range(0, end - begin, 16):
        mine = load_row(octants, 0, i) == np.int32(octant)
        mine &= first_lanes(end - begin - i)
        append_row(rays.number, 0, n, lane_index() + np.int32(begin + i), mine)
        n += popcount(mask_bits(mine))
    return n


@kernel
def lay_out(query, rays, n):
    """Write n rays in the layout of the tests; return the largest of their margins."""
    margin = splat_f32(0.0)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        number = load_row(rays.number, 0, i)
        o, d = gather3(query.origin, number, live), gather3(query.direction, number, live)
        t = gather_row(query.ends, 0, number, live)
        margin = maximum(margin, write_rays(rays, i, o, d, t))
    return largest(margin)


@kernel
def write_rays(rays, i, o, d, t):
    """Write 16 rays to indices i to i + 15; return their margins, see `origin_margins`."""
    r = safe_reciprocal(d)
    margin = (fabs(o.x) + fabs(o.y) + fabs(o.z)) * BOX_MARGIN
    store_columns(rays.for_boxes, INVERSE, i, r.x, r.y, r.z, t)
    store_columns(rays.for_boxes, START, i, o.x * r.x, o.y * r.y, o.z * r.z, margin)
    store_columns(rays.for_leaves, ORIGIN, i, o.x, o.y, o.z, t)
    store_columns(rays.for_leaves, DIRECTION, i, d.x, d.y, d.z, t)
    return margin
