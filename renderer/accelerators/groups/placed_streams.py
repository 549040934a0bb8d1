"""Streams through instances: all rays of a batch go down both levels of trees together.

As in `bvh.ray_streams`, the list of the rays that entered a node is tested against its
children, 16 rays at a time, and those that enter a child are its list. At an instance the
rays of the list are written once more as they are seen from there, and that list goes on in
the group's own tree.

The rays of one list go to all sides here. Which octant one belongs to changes from instance
to instance, and lists by octants would be short: of scenes/instances' bounce rays 47 stay
together at an instance by octants, 186 without (docs/performance.md, "Streams"). So boxes
are tested by their middle and half their size, where the signs of a direction do not
matter, and children come in the order that suits most rays of the list.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh import wide_bvh_build
from renderer.accelerators.bvh.bvh import STRETCH
from renderer.accelerators.bvh.bvh_split import MAX_DEPTH
from renderer.accelerators.bvh.octants import ROW, STREAM
from renderer.accelerators.bvh.stream_leaves import ENDED
from renderer.accelerators.bvh.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.groups.placed_rays import (
    DIRECTION,
    INVERSE,
    MARGIN,
    NUMBER,
    OBJECT,
    ORIGIN,
    PRIM,
    START,
    Rows,
    T,
    U,
    V,
    empty_rows,
    enter_instance,
    lay_out,
    leave_instance,
)
from renderer.accelerators.rays.packets import Nearest, nearest_of
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import absolute
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    first_lanes,
    lane,
    lane_index,
    lane_index_8,
    lower_half,
    lowest_bit,
    mask_bits,
    mask_of,
    maximum,
    minimum,
    popcount,
    select,
    smallest,
    splat_f32,
    splat_i32,
    upper_half,
)
from renderer.kernels.lanes.local import local_i32, local_rows_f32
from renderer.kernels.lanes.memory import (
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
from renderer.kernels.lanes.vectors import column3, gather_rows3
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, add_to, note_stack
from renderer.kinds.shapes.blocks import WIDTH, primitives_in
from renderer.kinds.shapes.primitives import hit_primitive

# Lists of no more rays than this are tested ray by ray, eight children at a time.
SHORT = 8
NEVER = np.int32(0x7FFFFFFF)  # above the bits of every float, and every id
# Levels of both trees; three more than one tree has, where a group's kinds are joined.
_LEVELS = 2 * (MAX_DEPTH + 4)
# A level's list, and 16 bits for each of eight children and 16 rays of it, in words of 32.
_LEVEL = ROW + ROW // 2 + 32
_LISTS = _LEVELS * _LEVEL
# words of a child that waits on the stack
_NODE = 0  # or ~leaf
_LIST = 1  # where its parent's list begins
_LENGTH = 2  # of that list
_MASKS = 3  # where the bits of those that entered the child begin, eight words apart
_WORD = 4
_STACK = _WORD * 8 * _LEVELS
# words of a leaf of primitives
FIRST = 0  # its first primitive
END = 1
KIND = 2  # which of the kinds of primitives
TOGETHER = 3  # leaves from this one on that are tested together, one of each kind
LEAF_WORDS = 4


class _Stream(NamedTuple):
    """The rays of a batch, and who goes where."""

    rows: Rows
    lists: Any  # (_LISTS,) int32 of places in the rows, and masks
    stack: Any  # (_STACK,) int32 children that wait
    planes: Any  # (3, 16) float32 for each axis 8 middles of boxes, 8 times half their size
    entered: Any  # (16,) int32 whether any ray entered the child


@kernel
def trace_placed(instances, query, instance, first, count, tally):
    """Answer what is asked of rays first to first + count - 1."""
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
                _descend(instances, query, instance, stream, n, np.int64(start), tally)


@kernel
def _descend(instances, query, instance, stream, n, node, tally):
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
                _meet_leaf(instances, at, query.any_will_do, rows, lists, place, m)
        if inside >= 0 and depth == floor:
            leave_instance(query, instance, inside, rows, guests)
            inside = np.int64(-1)
        if depth == 0:
            break
        depth -= 1
        node = np.int64(load_one(stream.stack, 0, _WORD * depth + _NODE))
        place, m = _list_of_child(stream, _WORD * depth)


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
        _write_planes(nodes, node, axis, stream.planes)
    masks = (place + m + 15) & ~15
    if m <= SHORT:
        octant = _enter_ray_by_ray(stream, place, m, masks)
    else:
        store_row(stream.entered, 0, 0, splat_i32(0))
        x, y, z = np.int64(0), np.int64(0), np.int64(0)  # rays that go down the axes
        for i in range(0, m, 16):
            a, b, c = _enter_children(stream, place + i, m - i, masks + i // 2, size)
            x, y, z = x + a, y + b, z + c
        octant = _most(x, m) | (_most(y, m) << 1) | (_most(z, m) << 2)
    order = np.int64(load_one(nodes.order, 0, 8 * node + octant))
    for _ in range(size):
        # without a branch: what no ray has entered is written over
        k = order & 7
        order >>= 4
        at = _WORD * depth
        store_one(stream.stack, 0, at + _NODE, load_one(nodes.integers, 0, word + k))
        store_one(stream.stack, 0, at + _LIST, place)
        store_one(stream.stack, 0, at + _LENGTH, m)
        store_one(stream.stack, 0, at + _MASKS, masks + k)
        depth += 1 if load_one(stream.entered, 0, k) != 0 else 0
    return depth


@kernel
def _most(down, m):
    return np.int64(1) if 2 * down > m else np.int64(0)


@kernel
def _write_planes(nodes, node, axis, planes):
    """Write the middles of the children's boxes along an axis, and half their sizes."""
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis
    word = node * WIDE_WORDS + axis
    half = np.float32(0.5) * load_one(nodes.floats, 0, word + SCALE)
    plane = load_bytes(nodes.octets, 0, octet)
    lower, upper = lower_half(plane), upper_half(plane)
    origin = load_one(nodes.floats, 0, word + wide_bvh_build.ORIGIN)
    store_row(planes, axis, 0, (lower + upper) * half + origin)
    store_row(planes, axis, 8, (upper - lower) * half)


@kernel
def _enter_children(stream, place, left, masks, size):
    """Test the next 16 rays of a list, or as many as are left, against all children.

    Where a ray passes the middle of a box, and half the box's size away from there. Its
    rounding error is that of moving the box by 3 * 2^-23 (|b| + |o|); boxes and origins are
    padded by five times that.

    Return how many of the rays go down the x, y and z axis.
    """
    floats, planes = stream.rows.floats, stream.planes
    live = first_lanes(left)
    ray = load_row(stream.lists, 0, place)
    inverse = gather_rows3(floats, INVERSE, ray, live)
    start = gather_rows3(floats, START, ray, live)
    t = select(live, gather_row(floats, T, ray, live), ENDED)
    along = absolute(inverse)
    more = along * gather_row(floats, MARGIN, ray, live)
    for k in range(size):
        x = inverse.x * load_one(planes, 0, k) - start.x
        y = inverse.y * load_one(planes, 1, k) - start.y
        z = inverse.z * load_one(planes, 2, k) - start.z
        half_x = along.x * load_one(planes, 0, k + 8) + more.x
        half_y = along.y * load_one(planes, 1, k + 8) + more.y
        half_z = along.z * load_one(planes, 2, k + 8) + more.z
        enter = maximum(
            maximum(x - half_x, y - half_y), maximum(z - half_z, splat_f32(0.0))
        )
        leave = minimum(minimum(x + half_x, y + half_y), z + half_z)
        bits = mask_bits(enter <= minimum(leave * STRETCH, t))
        store_one(stream.lists, 0, masks + k, bits)
        store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)
    return (
        popcount(mask_bits(inverse.x < 0.0)),
        popcount(mask_bits(inverse.y < 0.0)),
        popcount(mask_bits(inverse.z < 0.0)),
    )


@kernel
def _enter_ray_by_ray(stream, place, m, masks):
    """Test the rays of a short list against eight children; return the first's octant."""
    floats, planes = stream.rows.floats, stream.planes
    entered = lane_index_8() & 0
    octant = np.int64(0)
    for j in range(m - 1, -1, -1):  # so that the first one's octant stays
        ray = np.int64(load_one(stream.lists, 0, place + j))
        enter = lower_half(splat_f32(0.0))
        leave = enter + load_one(floats, T, ray)
        octant = np.int64(0)
        for axis in range(3):
            inverse = load_one(floats, INVERSE + axis, ray)
            middle = load_eight(planes, axis, 0) * inverse
            middle = middle - load_one(floats, START + axis, ray)
            half = load_eight(planes, axis, 8) + load_one(floats, MARGIN, ray)
            half = half * fabs(inverse)
            enter = maximum(enter, middle - half)
            leave = minimum(leave, (middle + half) * STRETCH)
            octant |= np.int64(1 if inverse < 0.0 else 0) << axis
        entered = select(enter <= leave, entered | np.int32(1 << j), entered)
    store_row(stream.lists, 0, masks, entered)
    store_row(stream.entered, 0, 0, entered)
    return octant


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
def _meet_leaf(instances, leaf, any_will_do, rows, lists, place, m):
    """Test the rays of a list against the primitives of a leaf, which are of one kind."""
    first = np.int64(load_one(instances.leaves, 0, leaf + FIRST))
    end = np.int64(load_one(instances.leaves, 0, leaf + END))
    kind = load_one(instances.leaves, 0, leaf + KIND)
    if kind == 0:
        _meet(instances.triangles, first, end, any_will_do, rows, lists, place, m)
    elif kind == 1:
        _meet(instances.rectangles, first, end, any_will_do, rows, lists, place, m)
    elif kind == 2:
        _meet(instances.disks, first, end, any_will_do, rows, lists, place, m)
    elif kind == 3:
        _meet(instances.spheres, first, end, any_will_do, rows, lists, place, m)
    elif kind == 4:
        _meet(instances.cylinders, first, end, any_will_do, rows, lists, place, m)
    elif kind == 5:
        _meet_together(instances.implicits, first, end, any_will_do, rows, lists, place, m)
    else:
        _meet_together(instances.sdf_cells, first, end, any_will_do, rows, lists, place, m)


@kernel
def _meet(primitives, first, end, any_will_do, rows, lists, place, m):
    """Test the rays of a list against primitives in blocks of eight."""
    if primitives is None:
        return
    if m > SHORT:
        _meet_together(primitives, first, end, any_will_do, rows, lists, place, m)
        return
    for j in range(m):
        ray = np.int64(load_one(lists, 0, place + j))
        for block in range(first >> 3, (end + 7) >> 3):
            _meet_block(primitives, block, any_will_do, rows, ray)


@kernel
def _meet_block(blocks, block, any_will_do, rows, ray):
    """Test one ray against eight primitives."""
    floats, integers = rows.floats, rows.integers
    t_before = load_one(floats, T, ray)
    origin, direction = column3(floats, ORIGIN, ray), column3(floats, DIRECTION, ray)
    x = hit_primitive(blocks, primitives_in(blocks, block), origin, direction, t_before)
    if mask_bits(x.hit) == 0:
        return
    if any_will_do != 0:
        store_one(floats, T, ray, ENDED)
        return
    # the least t, then the least id among those
    bits = select(x.hit, as_i32(x.t), NEVER)
    t_bits = smallest(bits)
    ids = select(bits == t_bits, load_eight(blocks.id, 0, WIDTH * block), NEVER)
    prim = smallest(ids)
    t = as_f32(t_bits)
    prim_before = load_one(integers, PRIM, ray)
    if t < t_before or prim_before < 0 or prim < prim_before:
        k = lowest_bit(mask_bits(ids == prim))
        store_one(floats, T, ray, t)
        store_one(integers, PRIM, ray, prim)
        store_one(floats, U, ray, lane(x.u, k))
        store_one(floats, V, ray, lane(x.v, k))


@kernel
def _meet_together(primitives, first, end, any_will_do, rows, lists, place, m):
    """Test each 16 rays against one primitive after the other."""
    if primitives is None:
        return
    floats, integers = rows.floats, rows.integers
    zero = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(lists, 0, place + i)
        origin = gather_rows3(floats, ORIGIN, ray, live)
        direction = gather_rows3(floats, DIRECTION, ray, live)
        t = select(live, gather_row(floats, T, ray, live), ENDED)
        prim = gather_row(integers, PRIM, ray, live)
        before = Nearest(t, prim, t, t)  # u and v as good as any: no hit yet
        near = nearest_of(
            primitives, first, end, origin, direction, before, None, zero, zero
        )
        found = live & (near.prim != prim)
        if mask_bits(found) == 0:
            continue
        if any_will_do != 0:
            scatter_row(floats, T, ray, splat_f32(ENDED), found)
            continue
        scatter_row(floats, T, ray, near.t, found)
        scatter_row(integers, PRIM, ray, near.prim, found)
        scatter_row(floats, U, ray, near.u, found)
        scatter_row(floats, V, ray, near.v, found)


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
