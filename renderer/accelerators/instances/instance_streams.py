"""Streams through instances: all rays of a batch go down both levels of trees together.

As in `bvh.streams.ray_streams`, the list of the rays that entered a node is tested against
its children, 16 rays at a time, and those that enter a child are its list. At an instance
the rays of the list are written once more as they are seen from there, and that list goes
on in the group's own tree.

The rays of one list go to all sides here. Which octant one belongs to changes from instance
to instance, and lists by octants would be short: of scenes/instances' bounce rays 47 stay
together at an instance by octants, 186 without (docs/performance.md, "Streams"). So boxes
are tested by their middle and half their size, where the signs of a direction do not
matter, and children come in the order that suits most rays of the list.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh_split import MAX_DEPTH
from renderer.accelerators.bvh.streams.stream_stack import (
    WAITING_WORDS,
    pop_child,
    push_children,
)
from renderer.accelerators.bvh.wide.octants import ROW, STREAM
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    CHILD,
    WIDE_WORDS,
)
from renderer.accelerators.instances.instance_boxes import (
    enter_children,
    enter_ray_by_ray,
    write_planes,
)
from renderer.accelerators.instances.instance_leaves import (
    END,
    FIRST,
    LEAF_WORDS,
    TOGETHER,
    intersect_leaf,
)
from renderer.accelerators.instances.instance_rays import (
    NUMBER,
    OBJECT,
    SHORT,
    Rows,
    empty_rows,
    enter_instance,
    lay_out,
    leave_instance,
)
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    lane_index,
    mask_bits,
    popcount,
    splat_i32,
)
from renderer.kernels.lanes.local import local_i32, local_rows_f32
from renderer.kernels.lanes.memory import (
    load_eight,
    load_one,
    store_row,
)
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, add_to, note_stack
from renderer.plugins.shapes.blocks import WIDTH

# Levels of both trees; three more than one tree has, where a group's kinds are joined.
_LEVELS = 2 * (MAX_DEPTH + 4)
# A level's list, and 16 bits for each of eight children and 16 rays of it, in words of 32.
_LEVEL = ROW + ROW // 2 + 32
_LISTS = _LEVELS * _LEVEL
_STACK = WAITING_WORDS * 8 * _LEVELS


class _Stream(NamedTuple):
    """The rays of a batch, and who goes where."""

    rows: Rows
    lists: Any  # (_LISTS,) int32 of places in the rows, and masks
    stack: Any  # (_STACK,) int32 children that wait
    planes: Any  # (3, 16) float32 for each axis 8 middles of boxes, 8 times half their size
    entered: Any  # (16,) int32 whether any ray entered the child


@kernel
def trace_placed(instances, query, first, count, tally):
    """Answer a query for rays first to first + count - 1; the last structure to do so."""
    if query.any_hit == 0:
        for i in range(first, first + count, 16):
            store_row(query.instance, 0, i, splat_i32(-1))
    stream = _Stream(
        empty_rows(),
        local_i32(_LISTS),
        local_i32(_STACK),
        local_rows_f32(3, 16),
        local_i32(16),
    )
    size = instances.placements.group.shape[0]
    for begin in range(first, first + count, STREAM):
        end = min(begin + STREAM, first + count)
        for beyond in range(2):
            n = lay_out(query, begin, end, instances.reach, beyond, stream.rows)
            if n == 0:
                continue
            # from beyond the reach that boxes are padded for: to every instance
            for k in range(size if beyond != 0 else 1):
                start = ~k if beyond != 0 else 0
                _descend(instances, query, stream, n, np.int64(start), tally)


@kernel
def _descend(instances, query, stream, n, node, tally):
    """Let n rays go down from a node of the world on, the nearest child first."""
    rows, lists = stream.rows, stream.lists
    size = np.int64(instances.placements.group.shape[0])
    _list_all(lists, 0, 0, n)
    place = np.int64(0)  # of the node's list
    m = n
    depth = np.int64(0)
    inside = np.int64(-1)  # the instance that rays are in
    floor = np.int64(0)  # how many wait that are outside of it
    guests = np.int64(0)  # how many rays are in it
    while True:
        if node >= 0:
            depth = _divide(instances, node, stream, place, m, depth)
            _add_node(tally, stream, place, m, depth, inside)
        elif ~node < size:
            guests = enter_instance(instances.placements, ~node, rows, lists, place, m)
            if guests > 0:
                inside, floor = ~node, depth
                node = np.int64(load_one(instances.root, 0, inside))
                place = (place + m + 15) & ~15
                m = guests
                _list_all(lists, place, OBJECT, m)
                continue
        else:
            leaf = LEAF_WORDS * (~node - size)
            end = leaf + LEAF_WORDS * load_one(instances.leaves, 0, leaf + TOGETHER)
            for at in range(leaf, end, LEAF_WORDS):
                _add_primitives(tally, instances.leaves, at, stream, place, m)
                intersect_leaf(instances, at, query.any_hit, rows, lists, place, m)
        if inside >= 0 and depth == floor:
            leave_instance(query, inside, rows, guests)
            inside = np.int64(-1)
        if depth == 0:
            break
        depth -= 1
        node, place, m = pop_child(stream, depth)


@kernel
def _list_all(lists, place, first, n):
    """List n rays from place `first` of the rows on."""
    for i in range(0, n, 16):
        store_row(lists, 0, place + i, lane_index() + np.int32(first + i))


# ------------------------------------------------------------------------- nodes


@kernel
def _divide(nodes, node, stream, place, m, depth):
    """Find who enters which child; push the children, the nearest last."""
    word = node * WIDE_WORDS + CHILD
    size = popcount(mask_bits(load_eight(nodes.integers, 0, word) != 0))
    for axis in range(3):
        write_planes(nodes, node, axis, stream.planes)
    masks = (place + m + 15) & ~15
    if m <= SHORT:
        octant = enter_ray_by_ray(stream, place, m, masks)
    else:
        store_row(stream.entered, 0, 0, splat_i32(0))
        x, y, z = np.int64(0), np.int64(0), np.int64(0)  # rays that go down the axes
        for i in range(0, m, 16):
            a, b, c = enter_children(stream, place + i, m - i, masks + i // 2, size)
            x, y, z = x + a, y + b, z + c
        octant = _most(x, m) | (_most(y, m) << 1) | (_most(z, m) << 2)
    return push_children(nodes, node, octant, size, stream, place, m, masks, depth)


@kernel
def _most(down, m):
    return np.int64(1) if 2 * down > m else np.int64(0)


# ---------------------------------------------------------------------- counting


@kernel
def _number(stream, place, inside):
    """Return which ray of the batch it is that a place of a list names."""
    ray = stream.lists[place]
    if inside:
        ray = stream.rows.integers[NUMBER, ray]
    return stream.rows.integers[NUMBER, ray]


@kernel
def _add_node(tally, stream, place, m, depth, inside):
    if tally is None:
        return
    for j in range(place, place + m):
        i = _number(stream, j, inside >= 0)
        add_to(tally, NODES, i, 1)
        add_to(tally, BOXES, i, WIDTH)
        note_stack(tally, i, depth)


@kernel
def _add_primitives(tally, leaves, leaf, stream, place, m):
    if tally is None:
        return
    for j in range(place, place + m):
        tested = leaves[leaf + END] - leaves[leaf + FIRST]
        add_to(tally, PRIMITIVES, _number(stream, j, True), tested)
