"""Stream traversal of the wide tree.

The rays of one octant of directions are traced together: they share near and far planes
and the order of children. A list that has become short is traced ray by ray (`wide_rays`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh_split import MAX_DEPTH
from renderer.accelerators.bvh.streams.stream import (
    LEVEL,
    WAITING_WORDS,
    Stream,
    add_nodes,
    descend,
    descend_tree,
    list_all,
    push_children,
    visit,
)
from renderer.accelerators.bvh.streams.stream_leaves import intersect_leaf
from renderer.accelerators.bvh.wide.octants import (
    AFAR,
    ENDED,
    ROW,
    STREAM,
    StreamRays,
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
from renderer.accelerators.bvh.wide.wide_rays import STACK, trace_rays
from renderer.accelerators.rays.box_entry import STRETCH
from renderer.kernels.jit import always_inline, kernel
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
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.mathematics import multiply_add
from renderer.kernels.lanes.memory import (
    append_row,
    gather_columns,
    gather_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import (
    local_columns_f32,
    local_f32,
    local_i32,
    lower_half3,
    upper_half3,
    vec3,
)
from renderer.plugins.shapes.blocks import WIDTH

# Lists of no more rays are traced ray by ray; from 3 to 8 some meshes gain, others lose.
SHORT = 6
# Rays from farther away than this many times the tree's reach are traced one by one: the
# boxes of a stream are padded by the margin of its farthest origin. With one ray at 1e6, a
# thousand others tested all boxes.
NEAR = np.float32(8.0)
_INFINITY = np.float32(np.inf)
_LISTS = (MAX_DEPTH + 2) * LEVEL
_STACK = WAITING_WORDS * STACK


class OctantTree(NamedTuple):
    """The wide tree, with the state of one octant's traversal."""

    accel: Any  # a `WideBvh`
    octant: int
    margin: float  # float32 padding of boxes, for all rays
    short: int  # lists of no more rays are traced ray by ray


@kernel
def trace_stream(accel, query, first, count, tally):
    """Answer a query for rays first to first + count - 1."""
    octants, number = local_i32(ROW), local_i32(ROW)
    rays = StreamRays(number, local_columns_f32(8, ROW), local_columns_f32(8, ROW))
    stream = Stream(
        rays, number, local_i32(_LISTS), local_i32(_STACK), local_f32(48), local_i32(16)
    )
    zero = np.int64(0)
    near = NEAR * _reach(accel)
    for begin in range(first, first + count, STREAM):
        end = min(begin + STREAM, first + count)
        few = end - begin < accel.few
        write_octants(query, begin, end, _INFINITY if few else near, not few, octants)
        for octant in range(1 if few else AFAR + 1):
            n = select_octant(begin, end, octant, octants, rays)
            if n == 0:
                continue
            # one padding for all rays: their own margins would be three more gathers
            margin = lay_out(query, rays, n)
            short = n if few or octant == AFAR else np.int64(SHORT)
            tree = OctantTree(accel, octant, margin, short)
            list_all(stream.lists, zero, n)
            descend(tree, query, stream, zero, zero, n, zero, tally)


@kernel
def _reach(accel):
    """Return |x| + |y| + |z| of the farthest corner of the root's box."""
    reach = np.float32(0.0)
    for axis in range(3):
        low = load_one(accel.floats, 0, ORIGIN + axis)
        high = low + np.float32(255.0) * load_one(accel.floats, 0, SCALE + axis)
        reach += max(abs(low), abs(high))
    return reach


@visit.by(OctantTree)
@kernel
def _visit(tree, query, stream, node, place, m, depth, tally):
    if m <= tree.short:
        _hand_over(tree.accel, query, stream, place, m, node, tally)
    elif node >= 0:
        depth = _divide(tree, node, stream, place, m, depth)
        add_nodes(tally, stream, place, m, depth)
    else:
        blocks, lists = tree.accel.blocks, stream.lists
        intersect_leaf(blocks, ~node, query, stream.rays, lists, place, m, tally)
    return depth


descend.by(OctantTree)(descend_tree)


# ------------------------------------------------------------------------------- nodes


@kernel
def _divide(tree, node, stream, place, m, depth):
    """Find which rays enter which child; push the children, the nearest last."""
    accel, octant, margin = tree.accel, tree.octant, tree.margin
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
    """Write the planes of the children's boxes along an axis, near planes first."""
    # bytes are lower, upper, lower: from the second on, near planes are the upper ones
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
    """Test the next 16 rays of a list, or the `left` remaining, against all children.

    (b - o) / d is computed as b / d - o / d, with the rounding bound of `_bundle_enters`.
    """
    live = first_lanes(left)
    ray = load_row(stream.lists, 0, place)
    x, y, z, t = gather_columns(stream.rays.for_boxes, 0, ray, live)
    start_x, start_y, start_z, _ = gather_columns(stream.rays.for_boxes, 4, ray, live)
    inverse, start = vec3(x, y, z), vec3(start_x, start_y, start_z)
    t = select(live, t, ENDED)
    planes = stream.planes
    if HAS_AVX2_ONLY:  # two loops: 16 rays and their distances exceed the registers
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
    """Return the bits of the rays that enter child k before t_max."""
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


# ------------------------------------------------------------------------- short lists


@kernel
def _hand_over(accel, query, stream, place, m, node, tally):
    """Trace the rays of a list one by one, from this node on."""
    queue = (place + m + 15) & ~15
    going = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        live &= gather_row(stream.rays.for_boxes, T, ray, live) >= 0.0
        append_row(stream.lists, 0, queue + going, ray, live)
        going += popcount(mask_bits(live))
    trace_rays(accel, query, stream.rays, stream.lists, queue, going, node, tally)
