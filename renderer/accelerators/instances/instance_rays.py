"""Rays in the object space of an instance, and their box tests."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.streams.stream import Stream, push_children
from renderer.accelerators.bvh.wide import wide_bvh_build
from renderer.accelerators.bvh.wide.octants import (
    DIRECTION,
    ENDED,
    INVERSE,
    MARGIN,
    ORIGIN,
    START,
    T,
    write_rays,
)
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.rays.box_entry import STRETCH
from renderer.accelerators.rays.query import Query
from renderer.kernels.jit import always_inline, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index_8,
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
from renderer.kernels.lanes.memory import (
    append_row,
    gather_columns,
    gather_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    scatter_row,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import absolute, affine_at, times, vec3

# ----------------------------------------------------------------------- instance boxes
# Which rays of a list enter which children of a node: 16 rays, or 8 boxes, at once.
#
# Each ray has its own margin, and directions may be of any octant. So boxes are tested by
# their centre and half their size, where the signs of a direction do not matter.

# Lists of no more rays are tested ray by ray, eight children or eight primitives at a
# time. With AVX2, all lists are at leaves.
SHORT = 8


@kernel
def _write_planes(nodes, node, axis, planes):
    """Write the centres of the children's boxes along an axis, and half their sizes."""
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis
    word = node * WIDE_WORDS + axis
    half = np.float32(0.5) * load_one(nodes.floats, 0, word + SCALE)
    plane = load_bytes(nodes.octets, 0, octet)
    lower, upper = lower_half(plane), upper_half(plane)
    origin = load_one(nodes.floats, 0, word + wide_bvh_build.ORIGIN)
    store_row(planes, 0, 16 * axis, (lower + upper) * half + origin)
    store_row(planes, 0, 16 * axis + 8, (upper - lower) * half)


@kernel
def _enter_children(stream, place, left, masks, size):
    """Test the next 16 rays of a list, or the `left` remaining, against all children.

    A slab is t to its centre, plus and minus half its size. The rounding error is that of
    moving the box by 3 * 2^-23 (|b| + |o|). Boxes and origins are padded by five times
    that.

    Returns how many of the rays have negative x, y and z directions.
    """
    for_boxes, planes = stream.rays.for_boxes, stream.planes
    live = first_lanes(left)
    ray = load_row(stream.lists, 0, place)
    x, y, z, t = gather_columns(for_boxes, INVERSE, ray, live)
    start_x, start_y, start_z, margin = gather_columns(for_boxes, START, ray, live)
    inverse, start = vec3(x, y, z), vec3(start_x, start_y, start_z)
    t = select(live, t, ENDED)
    along = absolute(inverse)
    more = along * margin
    for k in range(size):
        x = inverse.x * load_one(planes, 0, k) - start.x
        y = inverse.y * load_one(planes, 0, k + 16) - start.y
        z = inverse.z * load_one(planes, 0, k + 32) - start.z
        half_x = along.x * load_one(planes, 0, k + 8) + more.x
        half_y = along.y * load_one(planes, 0, k + 24) + more.y
        half_z = along.z * load_one(planes, 0, k + 40) + more.z
        enter = maximum(
            maximum(x - half_x, y - half_y), maximum(z - half_z, splat_f32(0.0))
        )
        leave = minimum(minimum(x + half_x, y + half_y), z + half_z)
        bits = mask_bits(enter <= minimum(leave * STRETCH, t))
        store_one(stream.lists, 0, masks + k, bits)
        store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)
    return (
        popcount(mask_bits((inverse.x < 0.0) & live)),
        popcount(mask_bits((inverse.y < 0.0) & live)),
        popcount(mask_bits((inverse.z < 0.0) & live)),
    )


@kernel
def _enter_ray_by_ray(stream, place, m, masks):
    """Test a short list's rays against eight children; return the first ray's octant."""
    for_boxes, planes = stream.rays.for_boxes, stream.planes
    entered = lane_index_8() & 0
    octant = np.int64(0)
    for j in range(m - 1, -1, -1):  # backwards, so that the first ray's octant remains
        ray = np.int64(load_one(stream.lists, 0, place + j))
        enter = lower_half(splat_f32(0.0))
        leave = enter + load_one(for_boxes, T, ray)
        octant = np.int64(0)
        for axis in range(3):
            inverse = load_one(for_boxes, INVERSE + axis, ray)
            middle = load_eight(planes, 0, 16 * axis) * inverse
            middle = middle - load_one(for_boxes, START + axis, ray)
            half = load_eight(planes, 0, 16 * axis + 8) + load_one(for_boxes, MARGIN, ray)
            half = half * fabs(inverse)
            # the operand that may be NaN comes first, so that the bound survives
            enter = maximum(middle - half, enter)
            leave = minimum((middle + half) * STRETCH, leave)
            octant |= np.int64(1 if inverse < 0.0 else 0) << axis
        entered = select(enter <= leave, entered | np.int32(1 << j), entered)
    store_row(stream.lists, 0, masks, entered)
    store_row(stream.entered, 0, 0, entered)
    return octant


@kernel
def divide_by_middle(nodes, node, stream, place, m, depth):
    """Find which rays enter which child; push the children, nearest last.

    The order is by the majority of the rays' direction signs.
    """
    always_inline()  # one call site per tree, which need not be a call in machine code
    word = node * WIDE_WORDS + CHILD
    size = popcount(mask_bits(load_eight(nodes.integers, 0, word) != 0))
    for axis in range(3):
        _write_planes(nodes, node, axis, stream.planes)
    masks = (place + m + 15) & ~15
    if m <= SHORT:
        octant = _enter_ray_by_ray(stream, place, m, masks)
    else:
        store_row(stream.entered, 0, 0, splat_i32(0))
        x, y, z = np.int64(0), np.int64(0), np.int64(0)  # counts of negative directions
        for i in range(0, m, 16):
            a, b, c = _enter_children(stream, place + i, m - i, masks + i // 2, size)
            x, y, z = x + a, y + b, z + c
        octant = _most(x, m) | (_most(y, m) << 1) | (_most(z, m) << 2)
    return push_children(nodes, node, octant, size, stream, place, m, masks, depth)


@kernel
def _most(down, m):
    return np.int64(1) if 2 * down > m else np.int64(0)


# ------------------------------------------------------------------------ instance rays
# The rays of a list in the object space of an instance, and their hits there.
#
# Two streams are used: the rays in the world, and the guests of an instance, which are the
# same rays in object space.


class World(NamedTuple):
    """The tree over the instances, and the rays inside one of them."""

    instances: Any
    guests: Stream  # share the world's lists and stack; `number` counts from 0
    found: Query  # query of the guests; its arrays hold their hits in the instance
    host: Any  # (ROW,) int32 index of each guest in the world's stream


@kernel
def enter_instance(world, k, stream, place, m, tally):
    """Transform a list's rays into instance k; return how many have not ended."""
    rays, guests, host = stream.rays, world.guests, world.host
    n = np.int64(0)
    for i in range(0, m, 16):
        live = first_lanes(m - i)
        ray = load_row(stream.lists, 0, place + i)
        live &= gather_row(rays.for_boxes, T, ray, live) >= 0.0
        append_row(host, 0, n, ray, live)
        n += popcount(mask_bits(live))
    matrix = affine_at(world.instances.placements.to_object, k)
    for i in range(0, n, 16):
        live = first_lanes(n - i)
        ray = load_row(host, 0, i)
        ox, oy, oz, _ = gather_columns(rays.for_leaves, ORIGIN, ray, live)
        dx, dy, dz, _ = gather_columns(rays.for_leaves, DIRECTION, ray, live)
        t = gather_row(rays.for_boxes, T, ray, live)
        origin = times(matrix, vec3(ox, oy, oz) - matrix.at)
        write_rays(guests.rays, i, origin, times(matrix, vec3(dx, dy, dz)), t)
        # no hit yet, so that equal hits in two instances are both reported
        store_row(world.found.prim, 0, i, splat_i32(-1))
        if tally is not None:
            counted = gather_row(stream.counted, 0, ray, live)
            store_row(guests.counted, 0, i, counted)
    return n


@kernel
def leave_instance(world, query, k, rays, n):
    """Keep the n guests' hits in instance k that are the nearest so far.

    At equal t the smallest primitive id wins, then the smallest instance id.
    """
    inside = world.found
    for i in range(0, n, 16):
        prim = load_row(inside.prim, 0, i)
        found = first_lanes(n - i) & (prim >= 0)
        if mask_bits(found) == 0:
            continue
        ray = load_row(world.host, 0, i)
        number = gather_row(rays.number, 0, ray, found)
        if query.any_hit != 0:
            scatter_row(rays.for_boxes, T, ray, splat_f32(ENDED), found)
            scatter_row(query.prim, 0, number, splat_i32(1), found)
            continue
        t = load_row(inside.ends, 0, i)
        t_before = gather_row(rays.for_boxes, T, ray, found)
        prim_before = gather_row(query.prim, 0, number, found)
        instance_before = gather_row(query.instance, 0, number, found)
        wins = (t < t_before) | (prim_before < 0) | (prim < prim_before)
        wins |= (prim == prim_before) & (instance_before > np.int32(k))
        wins &= found
        scatter_row(rays.for_boxes, T, ray, t, wins)
        scatter_row(query.ends, 0, number, t, wins)
        scatter_row(query.prim, 0, number, prim, wins)
        scatter_row(query.u, 0, number, load_row(inside.u, 0, i), wins)
        scatter_row(query.v, 0, number, load_row(inside.v, 0, i), wins)
        scatter_row(query.instance, 0, number, splat_i32(k), wins)
