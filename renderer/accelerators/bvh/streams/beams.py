"""Beams: find the nodes at which the bundles of a batch enter a tree, once per batch.

A beam is the box of some rays' origins and the box of their directions. If the beam of a
batch (of camera rays, say) misses a node, all its rays miss it [Reshetov2005]. The
remaining tree is a list of nodes. Each bundle of 16 rays has a beam of its own, which is
tested against 16 listed nodes at once; the traversal starts at those it may hit instead of
at the root. The rays are tested against these nodes as usual, so a beam that is too wide
costs time but no hit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

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
from renderer.accelerators.rays.single_ray import is_finite_ray
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    first_lanes,
    lane,
    largest,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    smallest,
    splat_f32,
    splat_mask,
)
from renderer.kernels.lanes.memory import (
    append_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import load3, vec3

ENTRIES = 64  # most nodes in the list of a batch
ROOM = ENTRIES + 16  # of a list, so that 16 may be read from its last entry
# An axis does not narrow an interval if the directions along it have both signs, or if one
# is smaller than this share of the largest component.
_LEAST_SHARE = np.float32(1e-6)
_INFINITY = np.float32(np.inf)


class Beam(NamedTuple):
    """The boxes of some rays' origins and reciprocal directions, as scalars."""

    low: Any  # least origins, minus their margins
    high: Any
    least: Any  # of 1 / direction; 0 if the axis narrows nothing
    most: Any


class Entries(NamedTuple):
    """Two lists of nodes, each from far to near; one list is made from the other."""

    boxes: Any  # (6, 2 ROOM) float32 lower, then upper corners
    nodes: Any  # (2, 2 ROOM) int32 the wide node (or ~block), and its node among the pairs
    planes: Any  # (48,) float32 box planes of one node's children
    stack: Any  # (STACK + ROOM,) int32 traversal stack of a bundle


@kernel
def _least3(v, mask):
    """Return the minimum of each component over the lanes of a mask."""
    return vec3(
        smallest(select(mask, v.x, _INFINITY)),
        smallest(select(mask, v.y, _INFINITY)),
        smallest(select(mask, v.z, _INFINITY)),
    )


@kernel
def _most3(v, mask):
    return vec3(
        largest(select(mask, v.x, -_INFINITY)),
        largest(select(mask, v.y, -_INFINITY)),
        largest(select(mask, v.z, -_INFINITY)),
    )


@kernel
def _minimum3(a, b, mask):
    """Return the minimum of a and b where `mask`, else b."""
    return vec3(
        minimum(select(mask, a.x, b.x), b.x),
        minimum(select(mask, a.y, b.y), b.y),
        minimum(select(mask, a.z, b.z), b.z),
    )


@kernel
def _maximum3(a, b, mask):
    return vec3(
        maximum(select(mask, a.x, b.x), b.x),
        maximum(select(mask, a.y, b.y), b.y),
        maximum(select(mask, a.z, b.z), b.z),
    )


@kernel
def _beam(low, high, least, most):
    """Return the beam from the bounds of origins and directions."""
    x = max(abs(least.x), abs(most.x))
    y = max(abs(least.y), abs(most.y))
    limit = max(max(x, y), max(abs(least.z), abs(most.z))) * _LEAST_SHARE
    one, zero = np.float32(1.0), np.float32(0.0)
    narrows_x = (least.x > limit) | (most.x < -limit)
    narrows_y = (least.y > limit) | (most.y < -limit)
    narrows_z = (least.z > limit) | (most.z < -limit)
    return Beam(
        low,
        high,
        vec3(
            one / most.x if narrows_x else zero,
            one / most.y if narrows_y else zero,
            one / most.z if narrows_z else zero,
        ),
        vec3(
            one / least.x if narrows_x else zero,
            one / least.y if narrows_y else zero,
            one / least.z if narrows_z else zero,
        ),
    )


@kernel
def _between(enter, leave, lower, upper, low, high, least, most):
    """Narrow [enter, leave] to the earliest entry and the latest exit along one axis."""
    if least == 0.0:
        return enter, leave
    near, far = (lower - high, upper - low) if least > 0.0 else (upper - low, lower - high)
    enter = maximum(enter, minimum(near * least, near * most))
    leave = minimum(leave, maximum(far * least, far * most))
    return enter, leave


@kernel
def _meets(beam, lower, upper, zero):
    """Return the mask of the boxes that a beam may hit; `zero` sets the number of lanes."""
    b = beam
    leave = zero + _INFINITY
    enter, leave = _between(
        zero, leave, lower.x, upper.x, b.low.x, b.high.x, b.least.x, b.most.x
    )
    enter, leave = _between(
        enter, leave, lower.y, upper.y, b.low.y, b.high.y, b.least.y, b.most.y
    )
    enter, leave = _between(
        enter, leave, lower.z, upper.z, b.low.z, b.high.z, b.least.z, b.most.z
    )
    return enter <= leave * STRETCH


@kernel
def _bundle_beam(beam, alike, origin, direction, traced):
    """Return the beam of 16 rays; `alike` means that all origins are those of `beam`."""
    low, high = beam.low, beam.high
    if not alike:
        below, above = origin_margins(origin)
        low, high = _least3(below, traced), _most3(above, traced)
    least, most = _least3(direction, traced), _most3(direction, traced)
    return _beam(low, high, least, most)


@kernel
def begin_bundle(entries, begin, count, beam, alike, origin, direction, traced):
    """Push the entries that 16 rays may hit, nearest last; return their beam and number."""
    b = _bundle_beam(beam, alike, origin, direction, traced)
    boxes = entries.boxes
    depth = np.int64(0)
    for i in range(begin, begin + count, 16):
        lower = vec3(load_row(boxes, 0, i), load_row(boxes, 1, i), load_row(boxes, 2, i))
        upper = vec3(load_row(boxes, 3, i), load_row(boxes, 4, i), load_row(boxes, 5, i))
        met = _meets(b, lower, upper, splat_f32(0.0)) & first_lanes(begin + count - i)
        append_row(entries.stack, 0, depth, load_row(entries.nodes, 1, i), met)
        depth += popcount(mask_bits(met))
    return b, depth


@kernel
def meets_in_leaf(boxes, block, beam):
    """Return the bits of the primitives of a block that the rays of a beam may hit."""
    lower = vec3(
        load_eight(boxes, block, 0),
        load_eight(boxes, block, 8),
        load_eight(boxes, block, 16),
    )
    upper = vec3(
        load_eight(boxes, block, 24),
        load_eight(boxes, block, 32),
        load_eight(boxes, block, 40),
    )
    return mask_bits(_meets(beam, lower, upper, as_f32(as_i32(lower.x) & 0)))


@kernel
def find_entries(accel, rays, ends, first, count, entries):
    """Find the nodes where rays first to first + count - 1 enter the tree before t_max.

    Returns the beam, whether all rays have one origin, and the begin and length of the
    list in `entries`.
    """
    inf, minus = splat_f32(_INFINITY), splat_f32(-_INFINITY)
    low, least = vec3(inf, inf, inf), vec3(inf, inf, inf)
    high, most = vec3(minus, minus, minus), vec3(minus, minus, minus)
    end = minus
    start = load3(rays.origin, first)
    start = vec3(lane(start.x, 0), lane(start.y, 0), lane(start.z, 0))
    other = splat_mask(False)
    for i in range(first, first + count, 16):
        origin, direction = load3(rays.origin, i), load3(rays.direction, i)
        live = first_lanes(first + count - i) & is_finite_ray(origin, direction)
        below, above = origin_margins(origin)
        low, high = _minimum3(below, low, live), _maximum3(above, high, live)
        least = _minimum3(direction, least, live)
        most = _maximum3(direction, most, live)
        end = maximum(select(live, load_row(ends, 0, i), end), end)
        moved = (origin.x != start.x) | (origin.y != start.y) | (origin.z != start.z)
        other = other | (moved & live)
    every = splat_mask(True)
    least, most = _least3(least, every), _most3(most, every)
    beam = _beam(_least3(low, every), _most3(high, every), least, most)
    octant = 1 if least.x + most.x < 0.0 else 0
    octant |= 2 if least.y + most.y < 0.0 else 0
    octant |= 4 if least.z + most.z < 0.0 else 0
    begin, n = _open_nodes(accel, beam, largest(end), octant, entries)
    return beam, mask_bits(other) == 0, begin, n


@kernel
def _open_nodes(accel, beam, end, octant, entries):
    """Replace nodes by their children, level by level, while there is room.

    A list ends at the end of its half of the memory and grows towards the front. The
    nearest nodes are at its end and are opened first, in case there is no room for all.
    """
    nodes, boxes = entries.nodes, entries.boxes
    count = np.int64(1)
    begin = np.int64(ENTRIES - 1)
    store_one(nodes, 0, begin, 0)
    store_one(nodes, 1, begin, 0)
    for row in range(3):
        # unbounded: each bundle tests the root's own box
        store_one(boxes, row, begin, np.float32(-np.inf))
        store_one(boxes, 3 + row, begin, np.float32(np.inf))
    while True:
        to = np.int64(ENTRIES + ROOM if begin < ENTRIES else ENTRIES)
        last = to
        opened = False
        for j in range(begin + count - 1, begin - 1, -1):
            node = np.int64(load_one(nodes, 0, j))
            if node >= 0 and last - to + ENTRIES >= 8 + j - begin:
                last = _open_one(accel, node, beam, end, octant, entries, last)
                opened = True
                continue
            last -= 1
            for row in range(2):
                store_one(nodes, row, last, load_one(nodes, row, j))
            for row in range(6):
                store_one(boxes, row, last, load_one(boxes, row, j))
        begin, count = last, to - last
        if not opened:
            return begin, count


@kernel
def _children_between(accel, node, axis, enter, leave, planes, low, high, least, most):
    """Narrow the intervals of a node's children by one axis; store their planes."""
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis
    word = node * WIDE_WORDS + axis
    unit = load_one(accel.floats, 0, word + SCALE)
    start = load_one(accel.floats, 0, word + ORIGIN)
    store_row(planes, 0, 16 * axis, load_bytes(accel.octets, 0, octet) * unit + start)
    lower = load_eight(planes, 0, 16 * axis)
    upper = load_eight(planes, 0, 16 * axis + 8)
    return _between(enter, leave, lower, upper, low, high, least, most)


@kernel
def _open_one(accel, node, beam, end, octant, entries, last):
    """Write the children that the beam may hit before `last`; return where they begin."""
    nodes, boxes, planes = entries.nodes, entries.boxes, entries.planes
    word = node * WIDE_WORDS + CHILD
    children = load_eight(accel.integers, 0, word)
    there = children != 0
    enter = as_f32(children & 0)
    leave = enter + end
    b = beam
    enter, leave = _children_between(
        accel, node, 0, enter, leave, planes, b.low.x, b.high.x, b.least.x, b.most.x
    )
    enter, leave = _children_between(
        accel, node, 1, enter, leave, planes, b.low.y, b.high.y, b.least.y, b.most.y
    )
    enter, leave = _children_between(
        accel, node, 2, enter, leave, planes, b.low.z, b.high.z, b.least.z, b.most.z
    )
    met = mask_bits(there & (enter <= leave * STRETCH))
    order = np.int64(load_one(accel.order, 0, 8 * node + octant))
    for nth in range(popcount(mask_bits(there)) - 1, -1, -1):
        k = (order >> (4 * nth)) & 7
        if (met >> k) & 1 == 0:
            continue
        last -= 1
        store_one(nodes, 0, last, load_one(accel.integers, 0, word + k))
        store_one(nodes, 1, last, load_one(accel.pair_of, 0, 8 * node + k))
        for axis in range(3):
            store_one(boxes, axis, last, load_one(planes, 0, 16 * axis + k))
            store_one(boxes, 3 + axis, last, load_one(planes, 0, 16 * axis + 8 + k))
    return last
