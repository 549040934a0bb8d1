"""Streams: all rays of a batch go down the wide tree together, as lists of their numbers.

At a node the list of the rays that entered it is tested against its children, 16 rays at a
time and without a branch that a single ray decides; those that enter a child are its list
[Barringer2014] [Fuetterling2015]. So it does not matter whether neighbours in the
batch go the same way, only that enough of the batch do, as the rays of a tile after a
bounce: docs/performance.md, "Streams".

The rays of an octant of directions go together. For them near and far planes are the same,
and children come in one order. A list that has become short is handed over to the rays
that go one by one (`wide_rays`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh_split import MAX_DEPTH
from renderer.accelerators.bvh.streams.stream_leaves import intersect_leaf
from renderer.accelerators.bvh.streams.stream_stack import (
    WAITING_WORDS,
    pop_child,
    push_children,
)
from renderer.accelerators.bvh.wide.octants import (
    AFAR,
    ENDED,
    ROW,
    STREAM,
    Octant,
    T,
    lay_out,
    select_octant,
    write_octants,
)
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.bvh.wide.wide_rays import STACK, add_node, trace_rays
from renderer.accelerators.rays.box_entry import STRETCH
from renderer.kernels.jit import always_inline, kernel
from renderer.kernels.lanes.columns import gather_columns
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    lower_half,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    splat_f32,
    splat_i32,
    upper_half,
)
from renderer.kernels.lanes.local import local_columns_f32, local_f32, local_i32
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.mathematics.fused import multiply_add
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import lower_half3, upper_half3, vec3
from renderer.plugins.shapes.blocks import WIDTH

# Rays of a list that is handed over: between 3 and 8 some meshes gain what others lose.
SHORT = 6
# Rays from farther than this many times the tree's reach go one by one: boxes are larger by
# the margin of the farthest origin. With one at 1e6 a thousand others tested all.
NEAR = np.float32(8.0)
# A level's list, and 16 bits for each of eight children and 16 rays of it, in words of 32.
_LEVEL = ROW + ROW // 2 + 32
_LISTS = (MAX_DEPTH + 2) * _LEVEL
_STACK = WAITING_WORDS * STACK


class _Stream(NamedTuple):
    """The rays of one octant, and who goes where."""

    rows: Octant
    lists: Any  # (_LISTS,) int32 of places in the rows, and masks
    stack: Any  # (_STACK,) int32 children that wait
    planes: Any  # (48,) float32 for each axis 8 near and 8 far planes
    entered: Any  # (16,) int32 whether any ray entered the child


@kernel
def trace_stream(accel, query, first, count, tally):
    """Answer what is asked of rays first to first + count - 1."""
    rows = Octant(
        local_i32(ROW),
        local_i32(ROW),
        local_columns_f32(8, ROW),
        local_columns_f32(8, ROW),
    )
    stream = _Stream(
        rows, local_i32(_LISTS), local_i32(_STACK), local_f32(48), local_i32(16)
    )
    near = NEAR * _reach(accel)
    for begin in range(first, first + count, STREAM):
        end = min(begin + STREAM, first + count)
        few = end - begin < accel.few
        write_octants(query, begin, end, few, near, rows)
        for octant in range(1 if few else AFAR + 1):
            n = select_octant(begin, end, octant, rows)
            if n == 0:
                continue
            margin = lay_out(query, rows, n)
            short = n if few or octant == AFAR else np.int64(SHORT)
            _descend(accel, query, stream, n, short, octant, margin, tally)


@kernel
def _reach(accel):
    """Return |x| + |y| + |z| of the farthest corner of the root's box."""
    reach = np.float32(0.0)
    for axis in range(3):
        low = load_one(accel.floats, 0, ORIGIN + axis)
        high = low + np.float32(255.0) * load_one(accel.floats, 0, SCALE + axis)
        reach += max(abs(low), abs(high))
    return reach


@kernel
def _descend(accel, query, stream, n, short, octant, margin, tally):
    """Let all rays of an octant go down the tree, the nearest child first."""
    for i in range(0, n, 16):
        store_row(stream.lists, 0, i, lane_index() + np.int32(i))
    node = np.int64(0)
    place = np.int64(0)  # of the node's list
    m = n
    depth = np.int64(0)
    while True:
        if m <= short:
            _hand_over(accel, query, stream, place, m, node, tally)
        elif node >= 0:
            depth = _divide(accel, node, octant, margin, stream, place, m, depth)
            _add_node(tally, stream, place, m, depth)
        else:
            rows, lists = stream.rows, stream.lists
            intersect_leaf(accel.blocks, ~node, query, rows, lists, place, m, tally)
        if depth == 0:
            break
        depth -= 1
        node, place, m = pop_child(stream, depth)


# ------------------------------------------------------------------------- nodes


@kernel
def _divide(accel, node, octant, margin, stream, place, m, depth):
    """Find who enters which child; push the children, the nearest last."""
    word = node * WIDE_WORDS + CHILD
    size = popcount(mask_bits(load_eight(accel.integers, 0, word) != 0))
    for axis in range(3):
        _write_planes(accel, node, axis, (octant >> axis) & 1, margin, stream.planes)
    store_row(stream.entered, 0, 0, splat_i32(0))
    masks = (place + m + 15) & ~15
    for i in range(0, m, 16):
        _enter_children(stream, place + i, m - i, masks + i // 2, size)
    return push_children(accel, node, octant, size, stream, place, m, masks, depth)


@kernel
def _write_planes(accel, node, axis, down, margin, planes):
    """Write where the children's boxes begin and end along an axis, near planes first."""
    # the bytes are lower, upper, lower: from the second on, upper bounds are the near ones
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis + 8 * down
    word = node * WIDE_WORDS + axis
    unit = load_one(accel.floats, 0, word + SCALE)
    origin = load_one(accel.floats, 0, word + ORIGIN)
    plane = multiply_add(load_bytes(accel.octets, 0, octet), unit, origin)
    farther = select(down != 0, -margin, margin)
    near = lane_index() < WIDTH
    plane = plane + select(near, splat_f32(-farther), splat_f32(farther))
    store_row(planes, 0, 16 * axis, plane)


@kernel
def _enter_children(stream, place, left, masks, size):
    """Test the next 16 rays of a list, or as many as are left, against all children.

    (b - o) / d as b / d - o / d, as for bundles, with the same bound of its rounding.
    """
    live = first_lanes(left)
    ray = load_row(stream.lists, 0, place)
    x, y, z, t = gather_columns(stream.rows.for_boxes, 0, ray, live)
    start_x, start_y, start_z, _ = gather_columns(stream.rows.for_boxes, 4, ray, live)
    inverse, start = vec3(x, y, z), vec3(start_x, start_y, start_z)
    t = select(live, t, ENDED)
    planes = stream.planes
    if HAS_AVX2_ONLY:  # two loops: 16 rays and their distances are more than its registers
        for k in range(size):
            low = _enters(
                planes, k, lower_half3(inverse), lower_half3(start), lower_half(t)
            )
            store_one(stream.lists, 0, masks + k, low)
        for k in range(size):
            high = _enters(
                planes, k, upper_half3(inverse), upper_half3(start), upper_half(t)
            )
            bits = load_one(stream.lists, 0, masks + k) | (high << 8)
            store_one(stream.lists, 0, masks + k, bits)
            store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)
        return
    for k in range(size):
        bits = _enters(planes, k, inverse, start, t)
        store_one(stream.lists, 0, masks + k, bits)
        store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)


@kernel
def _enters(planes, k, inverse, start, t):
    """Return the bits of the rays that enter child k before their end t."""
    always_inline()
    x0 = multiply_add(inverse.x, load_one(planes, 0, k), -start.x)
    x1 = multiply_add(inverse.x, load_one(planes, 0, k + 8), -start.x)
    y0 = multiply_add(inverse.y, load_one(planes, 0, k + 16), -start.y)
    y1 = multiply_add(inverse.y, load_one(planes, 0, k + 24), -start.y)
    z0 = multiply_add(inverse.z, load_one(planes, 0, k + 32), -start.z)
    z1 = multiply_add(inverse.z, load_one(planes, 0, k + 40), -start.z)
    enter = maximum(maximum(x0, y0), maximum(z0, np.float32(0.0)))
    leave = minimum(minimum(x1, y1), z1)
    return mask_bits(enter <= minimum(leave * STRETCH, t))


# --------------------------------------------------------------------- short lists


@kernel
def _hand_over(accel, query, stream, place, m, node, tally):
    """Let the rays of a list go on one by one."""
    queue = (place + m + 15) & ~15
    asked = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        live &= gather_row(stream.rows.for_boxes, T, ray, live) >= 0.0
        append_row(stream.lists, 0, queue + asked, ray, live)
        asked += popcount(mask_bits(live))
    trace_rays(accel, query, stream.rows, stream.lists, queue, asked, node, tally)


# ---------------------------------------------------------------------- counting


@kernel
def _add_node(tally, stream, place, m, depth):
    if tally is None:
        return
    for j in range(place, place + m):
        add_node(tally, stream.rows, stream.lists[j], depth)
