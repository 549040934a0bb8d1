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

from renderer.accelerators.bvh.bvh import MARGIN, STRETCH
from renderer.accelerators.bvh.bvh_split import MAX_DEPTH
from renderer.accelerators.bvh.ray_packets import safe_reciprocal
from renderer.accelerators.bvh.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.bvh.wide_rays import STACK, trace_rays
from renderer.accelerators.rays.packets import Nearest, blocked_by, nearest_of
from renderer.accelerators.rays.ray_interval import is_finite_ray
from renderer.jit import kernel
from renderer.kinds.shapes.blocks import WIDTH
from renderer.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    largest,
    mask_bits,
    mask_of,
    maximum,
    minimum,
    popcount,
    select,
    splat_f32,
    splat_i32,
)
from renderer.lanes.local import local_f32, local_i32
from renderer.lanes.memory import (
    append_row,
    gather_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    scatter_row,
    store_one,
    store_row,
)
from renderer.lanes.vectors import gather3, load3
from renderer.records.tally import BOXES, NODES, PRIMITIVES, add_to, note_stack

# Rays of a list that is handed over: between 3 and 8 some meshes gain what others lose.
SHORT = 6
STREAM = 1024  # rays that go together at most
_ROW = STREAM + 32
_NOBODY = 8  # in place of an octant: the ray has no answer to find
# A level's list, and 16 bits for each of eight children and 16 rays of it, in words of 32.
_LEVEL = _ROW + _ROW // 2 + 32
_LISTS = (MAX_DEPTH + 2) * _LEVEL
# words of a child that waits on the stack
_NODE = 0  # or ~block
_LIST = 1  # where its parent's list begins
_LENGTH = 2  # of that list
_MASKS = 3  # where the bits of those that entered the child begin, eight words apart
_WORD = 4
_STACK = _WORD * STACK
_ENDED = np.float32(-1.0)  # the end of a ray that enters nothing more


class _Stream(NamedTuple):
    """The rays of one octant, and their lists."""

    octant: Any  # (STREAM,) int32 of all rays of the batch
    number: Any  # (STREAM,) int32 in the batch
    t: Any  # (STREAM,) float32 where they end
    inverse_x: Any  # (STREAM,) float32 1 / direction
    inverse_y: Any
    inverse_z: Any
    start_x: Any  # (STREAM,) float32 origin / direction
    start_y: Any
    start_z: Any
    lists: Any  # (_LISTS,) int32 lists of places in the rows above, and masks
    stack: Any  # (_STACK,) int32 children that wait
    planes: Any  # (48,) float32 for each axis 8 near and 8 far planes
    entered: Any  # (16,) int32 whether any ray entered the child


@kernel
def trace_stream(accel, rays, ends, hits, blocked, first, count, tally):
    """Trace rays first to first + count - 1 to their nearest hit, or to any if `blocked`.

    `ends` is where the rays end: of the nearest hits, `hits.t`.
    """
    stream = _Stream(
        local_i32(_ROW),
        local_i32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_f32(_ROW),
        local_i32(_LISTS),
        local_i32(_STACK),
        local_f32(48),
        local_i32(16),
    )
    for begin in range(first, first + count, STREAM):
        end = min(begin + STREAM, first + count)
        few = end - begin < accel.few
        _write_octants(rays, blocked, begin, end, few, stream)
        for octant in range(1 if few else 8):
            n = _select_octant(begin, end, octant, stream)
            if n == 0:
                continue
            margin = _start(rays, ends, stream, n)
            short = n if few else np.int64(SHORT)
            depth = np.int64(0)
            node = np.int64(0)
            place = np.int64(0)  # of the node's list
            m = n
            while True:
                if m <= short:
                    _hand_over(
                        accel, rays, ends, hits, blocked, stream, place, m, node, tally
                    )
                elif node >= 0:
                    _add_node(tally, stream, place, m, depth)
                    depth = _divide(accel, node, octant, margin, stream, place, m, depth)
                else:
                    _add_primitives(tally, accel.blocks, ~node, stream, place, m)
                    _meet_leaf(accel.blocks, ~node, rays, hits, blocked, stream, place, m)
                if depth == 0:
                    break
                depth -= 1
                node = np.int64(load_one(stream.stack, 0, _WORD * depth + _NODE))
                place, m = _list_of_child(stream, _WORD * depth)


# ----------------------------------------------------------------------- the rays


@kernel
def _write_octants(rays, blocked, begin, end, few, stream):
    """Note the octant of each direction; 0 for all where they will not go together."""
    one, none = splat_i32(1), splat_i32(0)
    for i in range(begin, end, 16):
        d = load3(rays.direction, i)
        octant = (
            select(d.x < 0.0, one, none)
            | select(d.y < 0.0, one << 1, none)
            | select(d.z < 0.0, one << 2, none)
        )
        octant = none if few else octant
        asked = is_finite_ray(load3(rays.origin, i), d) & ~_shut(blocked, i)
        store_row(stream.octant, 0, i - begin, select(asked, octant, _NOBODY))


@kernel
def _shut(blocked, i):
    """Return which of 16 rays are blocked already."""
    if blocked is None:
        return ~first_lanes(16)
    return load_row(blocked, 0, i) != 0


@kernel
def _select_octant(begin, end, octant, stream):
    """List the numbers of the rays of an octant; return how many there are."""
    n = np.int64(0)
    for i in range(0, end - begin, 16):
        mine = load_row(stream.octant, 0, i) == np.int32(octant)
        mine &= first_lanes(end - begin - i)
        append_row(stream.number, 0, n, lane_index() + np.int32(begin + i), mine)
        n += popcount(mask_bits(mine))
    return n


@kernel
def _start(rays, ends, stream, n):
    """Write what the box tests of n rays need, and the root's list; return the margin.

    It is the largest of the rays' `origin_margins`. Boxes are made larger by it once, where
    the margin of each ray would be three numbers more to gather.
    """
    margin = splat_f32(0.0)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        number = load_row(stream.number, 0, i)
        origin = gather3(rays.origin, number, live)
        inverse = safe_reciprocal(gather3(rays.direction, number, live))
        store_row(stream.inverse_x, 0, i, inverse.x)
        store_row(stream.inverse_y, 0, i, inverse.y)
        store_row(stream.inverse_z, 0, i, inverse.z)
        store_row(stream.start_x, 0, i, origin.x * inverse.x)
        store_row(stream.start_y, 0, i, origin.y * inverse.y)
        store_row(stream.start_z, 0, i, origin.z * inverse.z)
        store_row(stream.t, 0, i, gather_row(ends, 0, number, live))
        store_row(stream.lists, 0, i, lane_index() + np.int32(i))
        far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
        margin = maximum(margin, far * MARGIN)
    return largest(margin)


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
    order = np.int64(load_one(accel.order, 0, 8 * node + octant))
    for _ in range(size):
        # without a branch: what no ray has entered is written over
        k = order & 7
        order >>= 4
        at = _WORD * depth
        store_one(stream.stack, 0, at + _NODE, load_one(accel.integers, 0, word + k))
        store_one(stream.stack, 0, at + _LIST, place)
        store_one(stream.stack, 0, at + _LENGTH, m)
        store_one(stream.stack, 0, at + _MASKS, masks + k)
        depth += 1 if load_one(stream.entered, 0, k) != 0 else 0
    return depth


@kernel
def _write_planes(accel, node, axis, down, margin, planes):
    """Write where the children's boxes begin and end along an axis, near planes first."""
    # the bytes are lower, upper, lower: from the second on, upper bounds are the near ones
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis + 8 * down
    word = node * WIDE_WORDS + axis
    unit = load_one(accel.floats, 0, word + SCALE)
    plane = load_bytes(accel.octets, 0, octet) * unit
    plane = plane + load_one(accel.floats, 0, word + ORIGIN)
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
    inverse_x = gather_row(stream.inverse_x, 0, ray, live)
    inverse_y = gather_row(stream.inverse_y, 0, ray, live)
    inverse_z = gather_row(stream.inverse_z, 0, ray, live)
    start_x = gather_row(stream.start_x, 0, ray, live)
    start_y = gather_row(stream.start_y, 0, ray, live)
    start_z = gather_row(stream.start_z, 0, ray, live)
    t = select(live, gather_row(stream.t, 0, ray, live), _ENDED)
    planes = stream.planes
    for k in range(size):
        x0 = inverse_x * load_one(planes, 0, k) - start_x
        x1 = inverse_x * load_one(planes, 0, k + 8) - start_x
        y0 = inverse_y * load_one(planes, 0, k + 16) - start_y
        y1 = inverse_y * load_one(planes, 0, k + 24) - start_y
        z0 = inverse_z * load_one(planes, 0, k + 32) - start_z
        z1 = inverse_z * load_one(planes, 0, k + 40) - start_z
        enter = maximum(maximum(x0, y0), maximum(z0, splat_f32(0.0)))
        leave = minimum(minimum(x1, y1), z1)
        bits = mask_bits(enter <= minimum(leave * STRETCH, t))
        store_one(stream.lists, 0, masks + k, bits)
        store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)


@kernel
def _list_of_child(stream, at):
    """Write the list of the child at a place of the stack; return where, and its length."""
    lists = stream.lists
    parent = np.int64(load_one(stream.stack, 0, at + _LIST))
    length = np.int64(load_one(stream.stack, 0, at + _LENGTH))
    masks = np.int64(load_one(stream.stack, 0, at + _MASKS))
    # behind the masks, and so behind all that waits
    place = (masks + (length + 15) // 16 * 8 + 15) & ~15
    m = np.int64(0)
    for i in range(0, length, 16):
        bits = np.int64(load_one(lists, 0, masks + i // 2))
        append_row(lists, 0, place + m, load_row(lists, 0, parent + i), mask_of(bits))
        m += popcount(bits)
    return place, m


# ------------------------------------------------------------------------ leaves


@kernel
def _meet_leaf(blocks, block, rays, hits, blocked, stream, place, m):
    """Test each 16 rays of a list against one primitive of a leaf after the other."""
    start = WIDTH * block
    end = start + _held(blocks, block)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        number = gather_row(stream.number, 0, ray, live)
        origin = gather3(rays.origin, number, live)
        direction = gather3(rays.direction, number, live)
        t = select(live, gather_row(stream.t, 0, ray, live), _ENDED)
        nearer, t = _meet_nearest(blocks, start, end, origin, direction, t, hits, number)
        shut = _meet_any(blocks, start, end, origin, direction, t, blocked, number)
        met = (nearer | shut) & live
        scatter_row(stream.t, 0, ray, select(shut, _ENDED, t), met)


@kernel
def _held(blocks, block):
    """Return how many primitives a block holds."""
    return popcount(mask_bits(load_eight(blocks.id, 0, WIDTH * block) >= 0))


@kernel
def _meet_nearest(blocks, start, end, origin, direction, t, hits, number):
    """Update the hits of 16 rays; return for which, and where these end now."""
    if hits is None:
        return ~first_lanes(16), t
    live = t >= 0.0
    prim = gather_row(hits.prim, 0, number, live)
    before = Nearest(t, prim, t, t)  # u and v as good as any: no hit yet
    zero = np.int64(0)
    found = nearest_of(blocks, start, end, origin, direction, before, None, zero, zero)
    nearer = live & (found.prim != prim)
    scatter_row(hits.t, 0, number, found.t, nearer)
    scatter_row(hits.prim, 0, number, found.prim, nearer)
    scatter_row(hits.u, 0, number, found.u, nearer)
    scatter_row(hits.v, 0, number, found.v, nearer)
    return nearer, found.t


@kernel
def _meet_any(blocks, start, end, origin, direction, t, blocked, number):
    """Set `blocked` of those of 16 rays that meet something; return which they are."""
    if blocked is None:
        return ~first_lanes(16)
    ended = ~(t >= 0.0)
    zero = np.int64(0)
    met = blocked_by(blocks, start, end, origin, direction, t, ended, None, zero, zero)
    met &= ~ended
    scatter_row(blocked, 0, number, splat_i32(1), met)
    return met


@kernel
def _hand_over(accel, rays, ends, hits, blocked, stream, place, m, node, tally):
    """Let the rays of a list go on one by one; then note where they end now."""
    queue = (place + m + 15) & ~15
    asked = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        live &= gather_row(stream.t, 0, ray, live) >= 0.0
        number = gather_row(stream.number, 0, ray, live)
        append_row(stream.lists, 0, queue + asked, number, live)
        asked += popcount(mask_bits(live))
    trace_rays(accel, rays, ends, hits, blocked, stream.lists, queue, asked, node, tally)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        number = gather_row(stream.number, 0, ray, live)
        t = gather_row(ends, 0, number, live)
        scatter_row(stream.t, 0, ray, _end_now(blocked, number, live, t), live)


@kernel
def _end_now(blocked, number, live, t):
    if blocked is None:
        return t
    return select(gather_row(blocked, 0, number, live) == 0, t, _ENDED)


# ---------------------------------------------------------------------- counting


@kernel
def _add_node(tally, stream, place, m, depth):
    if tally is None:
        return
    for j in range(place, place + m):
        i = stream.number[stream.lists[j]]
        add_to(tally, NODES, i, 1)
        add_to(tally, BOXES, i, WIDTH)
        note_stack(tally, i, depth)


@kernel
def _add_primitives(tally, blocks, block, stream, place, m):
    if tally is None:
        return
    for j in range(place, place + m):
        add_to(tally, PRIMITIVES, stream.number[stream.lists[j]], _held(blocks, block))
