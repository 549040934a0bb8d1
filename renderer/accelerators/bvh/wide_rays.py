"""Rays one by one through the wide tree, eight at the same time.

One ray is tested against eight boxes, or eight primitives, at once [Wald2008]. Incoherent
rays spend their time waiting for memory. Two things help: a node takes two cache lines,
because the boxes of its children are stored in bytes relative to its own [Ylitie2017]; and
`RAYS` rays are under way at the same time, in turn one step each, so that what a ray needs
next has arrived when its turn comes (docs/performance.md, "Beside Embree").
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh import STRETCH, origin_margins
from renderer.accelerators.bvh.octants import ENDED, T
from renderer.accelerators.bvh.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    lane,
    lane_index,
    lane_index_8,
    lower_half,
    lowest_bit,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    smallest,
    splat_f32,
    upper_half,
)
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.lanes.memory import (
    append_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    prefetch,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import column3
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, add_to, note_stack
from renderer.kinds.shapes.blocks import WIDTH, primitives_in
from renderer.kinds.shapes.primitives import hit_primitive

RAYS = 8  # under way at the same time; 4 to 16 were measured
# Places of a ray's stack: seven a level of at most 60, and room for eight to be written at
# once. Not a power of two, or the stacks of all rays would fall into the same cache sets.
STACK = 440
_STACKS = RAYS * STACK
_ROW = 96  # floats of a ray: for each axis 16 of the origin, 16 of the reciprocal
_ROWS = RAYS * _ROW
# integers of a ray
_NODE = 0  # where it is: a node, or ~block
_DEPTH = 1  # nodes on its stack
_RAY = 2  # its place in the rows of the stream
_NEAR_BYTES = 3  # 3 places in a node where its near bounds begin
_WORD = 8
_WORDS = RAYS * _WORD
_NEVER = np.int32(0x7FFFFFFF)  # above the bits of every float


class Query(NamedTuple):
    """What is asked of some rays: of one type, so that one traversal answers both kinds."""

    origin: Any  # (3, n) float32
    direction: Any  # (3, n) float32
    ends: Any  # (n,) float32 of a nearest hit, its t
    prim: Any  # (n,) int32 of the nearest hit; or 1 where a ray is blocked
    u: Any  # (n,) float32 of the nearest hit
    v: Any
    any_will_do: int  # not 0: any hit ends a ray and blocks it


@kernel
def nearest_hits(rays, hits):
    """Ask for the nearest hit of each ray."""
    return Query(
        rays.origin, rays.direction, hits.t, hits.prim, hits.u, hits.v, np.int64(0)
    )


@kernel
def any_hits(shadow_rays):
    """Ask which of the rays are blocked."""
    ends = shadow_rays.t_max
    return Query(
        shadow_rays.origin,
        shadow_rays.direction,
        ends,
        shadow_rays.blocked,
        ends,
        ends,
        np.int64(1),
    )


class _Flight(NamedTuple):
    """The rays under way."""

    words: Any  # (RAYS * 8,) int32
    rows: Any  # (RAYS * 96,) float32
    stack: Any  # (RAYS * STACK,) int32 nodes and blocks
    entries: Any  # (RAYS * STACK,) float32 where their boxes begin


@kernel
def trace_rays(accel, query, rows, queue, first, count, root, tally):
    """Trace the rays queue[first : first + count] on from node `root`.

    The queue names places of `rows`, an `octants.Octant`, where they are laid out. A ray
    takes one step, a node or a block, and then it is the next ray's turn.
    """
    flight = _Flight(
        local_i32(_WORDS), local_f32(_ROWS), local_i32(_STACKS), local_f32(_STACKS)
    )
    words, stack, entries = flight.words, flight.stack, flight.entries
    places = local_i32(RAYS)  # of the rays that are under way
    end = first + count
    flying = np.int64(0)
    while flying < RAYS and first < end:
        _start(rows, np.int64(load_one(queue, 0, first)), root, flight, flying)
        store_one(places, 0, flying, flying)
        flying += 1
        first += 1

    turn = np.int64(0)
    while flying > 0:
        if turn >= flying:
            turn = np.int64(0)
        place = np.int64(load_one(places, 0, turn))
        at = place * _WORD
        base = place * STACK
        node = np.int64(load_one(words, 0, at + _NODE))
        depth = np.int64(load_one(words, 0, at + _DEPTH))
        ray = np.int64(load_one(words, 0, at + _RAY))

        # one step
        if node >= 0:
            t_max = load_one(rows.for_boxes, T, ray)
            depth = _push_children(accel, node, t_max, flight, place, depth)
            add_node(tally, rows, ray, depth)
        else:
            _meet_block(accel.blocks, ~node, query, rows, ray, tally)

        # what to do next; nothing is left for a ray that has ended
        t_max = load_one(rows.for_boxes, T, ray)
        while depth > 0 and load_one(entries, 0, base + depth - 1) > t_max:
            depth -= 1
        if depth == 0:
            if first < end:
                _start(rows, np.int64(load_one(queue, 0, first)), root, flight, place)
                first += 1
                turn += 1
            else:
                flying -= 1
                store_one(places, 0, turn, load_one(places, 0, flying))
            continue
        depth -= 1
        node = np.int64(load_one(stack, 0, base + depth))
        store_one(words, 0, at + _NODE, node)
        store_one(words, 0, at + _DEPTH, depth)
        _prefetch(accel, node)
        turn += 1


# --------------------------------------------------------------------------- one ray


@kernel
def _start(rows, ray, root, flight, place):
    """Put a ray at the node where it begins."""
    low, high = origin_margins(column3(rows.for_leaves, 0, ray))
    inverse = column3(rows.for_boxes, 0, ray)
    row = place * _ROW
    at = place * _WORD
    words = flight.words
    store_one(words, 0, at + _NODE, root)
    store_one(words, 0, at + _DEPTH, 0)
    store_one(words, 0, at + _RAY, ray)
    x = _start_axis(low.x, high.x, inverse.x, flight.rows, row)
    y = _start_axis(low.y, high.y, inverse.y, flight.rows, row + 32)
    z = _start_axis(low.z, high.z, inverse.z, flight.rows, row + 64)
    store_one(words, 0, at + _NEAR_BYTES, BOX_BYTES + x)
    store_one(words, 0, at + _NEAR_BYTES + 1, BOX_BYTES + AXIS_BYTES + y)
    store_one(words, 0, at + _NEAR_BYTES + 2, BOX_BYTES + 2 * AXIS_BYTES + z)


@kernel
def _start_axis(low, high, inverse, rows, row):
    """Write an axis: 8 lanes for the near planes, 8 for the far ones; return the offset.

    Lower planes are measured from the origin moved up by its margin, upper ones from the
    origin moved down. The far half is negated, so that one maximum over the axes serves
    both: it gives where the ray enters, and minus where it leaves.
    """
    down = inverse < 0.0
    near = low if down else high
    far = high if down else low
    first = lane_index() < WIDTH
    store_row(rows, 0, row, select(first, splat_f32(near), splat_f32(far)))
    store_row(rows, 0, row + 16, select(first, splat_f32(inverse), splat_f32(-inverse)))
    # the bytes are lower, upper, lower: from the second on, upper bounds are the near ones
    return 8 if down else 0


@kernel
def _distances(accel, node, axis, flight, place):
    """Return the distances to the near planes, and minus those to the far ones."""
    at = np.int64(load_one(flight.words, 0, place * _WORD + _NEAR_BYTES + axis))
    word = node * WIDE_WORDS + axis
    row = place * _ROW + 32 * axis
    plane = load_bytes(accel.octets, 0, node * WIDE_BYTES + at) * load_one(
        accel.floats, 0, word + SCALE
    ) + load_one(accel.floats, 0, word + ORIGIN)
    return (plane - load_row(flight.rows, 0, row)) * load_row(flight.rows, 0, row + 16)


@kernel
def _push_children(accel, node, t_max, flight, place, depth):
    """Push the children that the ray enters, the nearest last; return the new depth.

    Without a branch: which children are entered is what no processor can predict.
    """
    x = _distances(accel, node, 0, flight, place)
    y = _distances(accel, node, 1, flight, place)
    z = _distances(accel, node, 2, flight, place)
    both = maximum(maximum(x, y), z)
    enter = maximum(lower_half(both), np.float32(0.0))
    leave = minimum(upper_half(both) * -STRETCH, t_max)
    word = node * WIDE_WORDS + CHILD
    children = load_eight(accel.integers, 0, word)
    enters = (enter <= leave) & (children != 0)

    # floats that are not negative are ordered as their bits are; the last three make room
    # for the lane
    keys = select(enters, (as_i32(enter) & ~7) | lane_index_8(), _NEVER)
    nearest = smallest(keys)
    others = enters & (keys != nearest)
    top = place * STACK + depth
    append_row(flight.stack, 0, top, children, others)
    append_row(flight.entries, 0, top, enter, others)
    count = popcount(mask_bits(others))
    j = np.int64(nearest & 7)
    store_one(flight.stack, 0, top + count, load_one(accel.integers, 0, word + j))
    store_one(flight.entries, 0, top + count, as_f32(np.int32(nearest & ~7)))
    return depth + count + (1 if mask_bits(enters) != 0 else 0)


@kernel
def _meet_block(blocks, block, query, rows, ray, tally):
    """Test a ray against a leaf's primitives."""
    i = np.int64(load_one(rows.number, 0, ray))
    _add_primitives(tally, blocks, block, i)
    origin, direction = column3(rows.for_leaves, 0, ray), column3(rows.for_leaves, 4, ray)
    t_max = load_one(rows.for_boxes, T, ray)
    x = hit_primitive(blocks, primitives_in(blocks, block), origin, direction, t_max)
    if mask_bits(x.hit) == 0:
        return
    if query.any_will_do == 0:
        _keep_nearest(query, rows, ray, i, x, blocks, block)
        return
    store_one(query.prim, 0, i, 1)
    store_one(rows.for_boxes, T, ray, ENDED)


@kernel
def _keep_nearest(query, rows, ray, i, x, blocks, block):
    """Update the hit of a ray, the i-th of the batch, with those of a block."""
    # the least t, then the least id among those
    bits = select(x.hit, as_i32(x.t), _NEVER)
    t_bits = smallest(bits)
    ids = select(bits == t_bits, load_eight(blocks.id, 0, WIDTH * block), _NEVER)
    prim = smallest(ids)
    j = lowest_bit(mask_bits(ids == prim))
    t = as_f32(t_bits)
    prim_before = load_one(query.prim, 0, i)
    if t < load_one(rows.for_boxes, T, ray) or prim_before < 0 or prim < prim_before:
        store_one(rows.for_boxes, T, ray, t)
        store_one(query.ends, 0, i, t)
        store_one(query.prim, 0, i, prim)
        store_one(query.u, 0, i, lane(x.u, j))
        store_one(query.v, 0, i, lane(x.v, j))


@kernel
def add_node(tally, rows, ray, depth):
    """Count that a ray, by its place in the rows, is tested against a node's children."""
    if tally is None:
        return
    i = rows.number[ray]
    add_to(tally, NODES, i, 1)
    add_to(tally, BOXES, i, WIDTH)
    note_stack(tally, i, depth)


@kernel
def _add_primitives(tally, blocks, block, i):
    if tally is None:
        return
    for j in range(WIDTH):
        if blocks.id[WIDTH * block + j] >= 0:
            tally[PRIMITIVES, i] += 1


@kernel
def _prefetch(accel, node):
    """Ask for what a ray will look at when its next turn comes."""
    # both kinds without a branch, which would be mispredicted: at worst, lines of node or
    # block 0 are asked for, which are there
    inner = max(node, 0) * WIDE_BYTES
    prefetch(accel.octets, 0, inner)
    prefetch(accel.octets, 0, inner + 64)
    rows = accel.blocks.rows
    for k in range(0, rows.shape[1], 16):
        prefetch(rows, max(~node, 0), k)
