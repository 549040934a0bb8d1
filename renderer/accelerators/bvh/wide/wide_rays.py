"""Traversal of the wide tree by single rays, eight of them interleaved.

One ray is tested against eight boxes, or eight primitives, at once [Wald2008]. Incoherent
rays are bound by memory latency, which two measures reduce. A node takes two cache lines,
as its children's boxes are stored in bytes relative to its own box [Ylitie2017]. `RAYS`
rays take turns of one step each, so that prefetched data has arrived when a ray's turn
comes (docs/performance.md, "Compared with Embree").
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.wide.octants import T
from renderer.accelerators.bvh.wide.one_ray_leaves import NEVER, intersect_block
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.rays.box_entry import STRETCH, origin_margins
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    lane_index,
    lane_index_8,
    lower_half,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    smallest,
    splat_f32,
    upper_half,
)
from renderer.kernels.lanes.mathematics import multiply_add
from renderer.kernels.lanes.memory import (
    append_row,
    load_bytes,
    load_eight,
    load_one,
    prefetch,
    store_one,
)
from renderer.kernels.lanes.vectors import column3, local_f32, local_i32
from renderer.kernels.records.batch import BOXES, NODES, add_to, note_stack
from renderer.plugins.shapes.blocks import AT_FIRST, WIDTH

RAYS = 8  # interleaved rays; 4 to 16 were measured
# Entries of a ray's stack: seven per level of at most 60, and room to write eight at once.
# Not a power of two, or the stacks of all rays would map to the same cache sets.
STACK = 440
_STACKS = RAYS * STACK
_ROW = 9  # floats of a ray, three per axis: see `_start_axis`
_ROWS = RAYS * _ROW
# integers of a ray
_NODE = 0  # current node, or ~block
_DEPTH = 1  # number of entries on its stack
_RAY = 2  # its index in the rows of the stream
_NEAR_BYTES = 3  # 3 byte offsets of the near bounds in a node
_WORD = 8
_WORDS = RAYS * _WORD


class _Flight(NamedTuple):
    """The interleaved rays."""

    words: Any  # (RAYS * 8,) int32
    rows: Any  # (RAYS * 9,) float32
    stack: Any  # (RAYS * STACK,) int32 nodes and blocks
    entries: Any  # (RAYS * STACK,) float32 t at which their boxes are entered


@kernel
def trace_rays(accel, query, rows, queue, first, count, root, tally):
    """Trace the rays queue[first : first + count] from node `root` on.

    The queue holds indices into `rows`, which are `octants.StreamRays`. Rays take turns:
    each step visits one node or block.
    """
    flight = _Flight(
        local_i32(_WORDS), local_f32(_ROWS), local_i32(_STACKS), local_f32(_STACKS)
    )
    words, stack, entries = flight.words, flight.stack, flight.entries
    places = local_i32(RAYS)  # of the interleaved rays
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
            add_node(tally, rows.number, ray, depth)
        else:
            intersect_block(accel.blocks, ~node, query, rows, ray, tally)

        # pop the next node that is entered before t_max; none for a ray that has ended
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


# ---------------------------------------------------------------------------- single ray


@kernel
def _start(rows, ray, root, flight, place):
    """Set a ray to its start node."""
    low, high = origin_margins(column3(rows.for_leaves, 0, ray))
    inverse = column3(rows.for_boxes, 0, ray)
    row = place * _ROW
    at = place * _WORD
    words = flight.words
    store_one(words, 0, at + _NODE, root)
    store_one(words, 0, at + _DEPTH, 0)
    store_one(words, 0, at + _RAY, ray)
    x = _start_axis(low.x, high.x, inverse.x, flight.rows, row)
    y = _start_axis(low.y, high.y, inverse.y, flight.rows, row + 3)
    z = _start_axis(low.z, high.z, inverse.z, flight.rows, row + 6)
    store_one(words, 0, at + _NEAR_BYTES, BOX_BYTES + x)
    store_one(words, 0, at + _NEAR_BYTES + 1, BOX_BYTES + AXIS_BYTES + y)
    store_one(words, 0, at + _NEAR_BYTES + 2, BOX_BYTES + 2 * AXIS_BYTES + z)


@kernel
def _start_axis(low, high, inverse, rows, row):
    """Write -n / d, f / d and 1 / d of an axis; return the offset of its near bounds.

    Near planes are measured from n, far planes from f. Lower planes use the origin moved
    up by its margin, upper planes the origin moved down. Distances are b / d - o / d, as
    in `_bundle_enters`.
    """
    down = inverse < 0.0
    store_one(rows, 0, row, -(low if down else high) * inverse)
    store_one(rows, 0, row + 1, (high if down else low) * inverse)
    store_one(rows, 0, row + 2, inverse)
    # bytes are lower, upper, lower: from the second on, near planes are the upper ones
    return 8 if down else 0


@kernel
def _distances(accel, node, axis, flight, place):
    """Return the distances to the eight near planes, and minus those to the far planes.

    One maximum over the axes then gives both the entry and minus the exit distance.
    """
    at = np.int64(load_one(flight.words, 0, place * _WORD + _NEAR_BYTES + axis))
    word = node * WIDE_WORDS + axis
    unit = load_one(accel.floats, 0, word + SCALE)
    origin = load_one(accel.floats, 0, word + ORIGIN)
    octets = load_bytes(accel.octets, 0, node * WIDE_BYTES + at)
    plane = multiply_add(octets, unit, origin)
    row = place * _ROW + 3 * axis
    near = splat_f32(load_one(flight.rows, 0, row))
    far = splat_f32(load_one(flight.rows, 0, row + 1))
    inverse = splat_f32(load_one(flight.rows, 0, row + 2))
    first = lane_index() < WIDTH
    return multiply_add(plane, select(first, inverse, -inverse), select(first, near, far))


@kernel
def _push_children(accel, node, t_max, flight, place, depth):
    """Push the children that the ray enters, nearest last; return the new depth.

    Branchless, since entries are unpredictable.
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

    # non-negative floats sort as their bits do; the last three bits hold the lane
    keys = select(enters, (as_i32(enter) & ~7) | lane_index_8(), NEVER)
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
def add_node(tally, number, ray, depth):
    """Count a test of a ray, by its index, against a node's children."""
    if tally is None:
        return
    i = number[ray]
    add_to(tally, NODES, i, 1)
    add_to(tally, BOXES, i, WIDTH)
    note_stack(tally, i, depth)


@kernel
def _prefetch(accel, node):
    """Prefetch what a ray reads at its next turn."""
    # Node and block are both prefetched, since a branch would be mispredicted. Where one
    # is meaningless, index 0 is fetched, which exists.
    inner = max(node, 0) * WIDE_BYTES
    prefetch(accel.octets, 0, inner)
    prefetch(accel.octets, 0, inner + 64)
    blocks, block = accel.blocks, max(~node, 0)
    prefetch(blocks.bounds, block, 0)
    for k in range(0, min(blocks.rows.shape[1], AT_FIRST), 16):
        prefetch(blocks.rows, block, k)
