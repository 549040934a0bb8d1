"""Bounding volume hierarchy: a binary tree of boxes, built by the surface area heuristic.

Coherent rays go as packets of 16 through the tree together, each box and each primitive
tested for all 16 at once. Incoherent rays go one by one, each leaf's primitives 16 at
once. A hit does not end the traversal: another box may hold a nearer one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.rays.box_entry import origin_margins, packet_enters, ray_enters
from renderer.accelerators.rays.packets import (
    Nearest,
    blocked_by,
    load_nearest,
    nearest_of,
    store_nearest,
)
from renderer.accelerators.rays.single_ray import (
    blocked_in_range,
    load_hit,
    nearest_in_range,
    store_hit,
)
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane,
    mask_bits,
    select,
    splat_i32,
)
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import column, load3, vec3
from renderer.kernels.records.tally import (
    BOXES,
    NODES,
    add_to,
    add_to_packet,
    note_packet_stack,
    note_stack,
)
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

STACK = 64  # at most `MAX_DEPTH` = 60 edges to a leaf
_INFINITY = np.float32(np.inf)


class Bvh(NamedTuple):
    """The tree's nodes, and the primitives in the order of its leaves."""

    bounds: NDArray[np.float32]  # (nodes, 6) lower x y z, upper x y z
    child: NDArray[np.int32]  # (nodes,) first of two children, or first primitive
    count: NDArray[np.int32]  # (nodes,) 0 for inner nodes, else primitives of the leaf
    primitives: Any  # a group of one kind, in leaf order


def build_bvh(extents: Extents, group: PrimitiveGroup, rule: str = "sah") -> Bvh:
    """Build by one of `bvh_build.RULES`."""
    tree = build_tree(extents.lower, extents.upper, rule=rule)
    return Bvh(tree.bounds, tree.child, tree.count, group(tree.order))


@kernel
def _second_child_first(bounds, child, direction):
    """Return whether the second child's centre comes first along a direction."""
    a, b = child, child + 1
    x = bounds[b, 0] + bounds[b, 3] - bounds[a, 0] - bounds[a, 3]
    y = bounds[b, 1] + bounds[b, 4] - bounds[a, 1] - bounds[a, 4]
    z = bounds[b, 2] + bounds[b, 5] - bounds[a, 2] - bounds[a, 5]
    return x * direction.x + y * direction.y + z * direction.z < 0.0


@method_kernel
def closest_hit_bvh_packets(bvh, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1, 16 rays at a time."""
    bounds, primitives = bvh.bounds, bvh.primitives
    stack = local_i32(STACK)
    for i in range(first, first + count, 16):
        origin = load3(rays.origin, i)
        direction = load3(rays.direction, i)
        inverse = 1.0 / direction
        low, high = origin_margins(origin)
        # lanes beyond the last ray end before they begin
        left = first + count - i
        given = load_nearest(hits, i)
        t = select(first_lanes(left), given.t, -1.0)
        nearest = Nearest(t, given.prim, given.u, given.v)
        leading = vec3(lane(direction.x, 0), lane(direction.y, 0), lane(direction.z, 0))
        stack[0] = 0
        depth = 1
        while depth > 0:
            note_packet_stack(tally, i, left, depth)
            depth -= 1
            node = stack[depth]
            add_to_packet(tally, BOXES, i, left, 1)
            enters = packet_enters(bounds, node, low, high, inverse, nearest.t)
            if mask_bits(enters) == 0:
                continue
            add_to_packet(tally, NODES, i, left, 1)
            child = bvh.child[node]
            if bvh.count[node] == 0:
                near = child
                if _second_child_first(bounds, child, leading):
                    near = child + 1
                stack[depth] = 2 * child + 1 - near
                stack[depth + 1] = near
                depth += 2
                continue
            end = child + bvh.count[node]
            nearest = nearest_of(
                primitives, child, end, origin, direction, nearest, tally, i, left
            )
        store_nearest(hits, i, nearest)


@method_kernel
def closest_hit_bvh(bvh, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1, one ray at a time."""
    for i in range(first, first + count):
        origin = column(rays.origin, i)
        direction = column(rays.direction, i)
        hit = nearest_of_ray(bvh, origin, direction, load_hit(hits, i), tally, i)
        store_hit(hits, i, hit)


@kernel
def nearest_of_ray(bvh, origin, direction, hit, tally, i):
    """Return the nearest hit of one ray after the whole tree was tested."""
    bounds, primitives = bvh.bounds, bvh.primitives
    inverse = np.float32(1.0) / direction
    low, high = origin_margins(origin)
    stack = local_i32(STACK)
    entries = local_f32(STACK)
    stack[0] = 0
    entries[0] = ray_enters(bounds, np.int64(0), low, high, inverse, hit.t)
    add_to(tally, BOXES, i, 1)
    depth = 1 if entries[0] < _INFINITY else 0
    while depth > 0:
        note_stack(tally, i, depth)
        depth -= 1
        if entries[depth] > hit.t:
            continue
        node = np.int64(stack[depth])
        add_to(tally, NODES, i, 1)
        child = np.int64(bvh.child[node])
        if bvh.count[node] == 0:
            near = child
            far = child + 1
            enter_near = ray_enters(bounds, near, low, high, inverse, hit.t)
            enter_far = ray_enters(bounds, far, low, high, inverse, hit.t)
            add_to(tally, BOXES, i, 2)
            if enter_far < enter_near:
                near, far = far, near
                enter_near, enter_far = enter_far, enter_near
            if enter_far < _INFINITY:
                stack[depth] = far
                entries[depth] = enter_far
                depth += 1
            if enter_near < _INFINITY:
                stack[depth] = near
                entries[depth] = enter_near
                depth += 1
            continue
        end = child + bvh.count[node]
        hit = nearest_in_range(primitives, child, end, origin, direction, hit, tally, i)
    return hit


@method_kernel
def any_hit_bvh_packets(bvh, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays, 16 rays at a time."""
    bounds, primitives = bvh.bounds, bvh.primitives
    stack = local_i32(STACK)
    for i in range(0, count, 16):
        origin = load3(shadow_rays.origin, i)
        direction = load3(shadow_rays.direction, i)
        inverse = 1.0 / direction
        low, high = origin_margins(origin)
        left = count - i
        t_max = load_row(shadow_rays.t_max, 0, i)
        blocked = (load_row(shadow_rays.blocked, 0, i) != 0) | ~first_lanes(left)
        stack[0] = 0
        depth = 1
        while depth > 0 and mask_bits(blocked) != 0xFFFF:
            note_packet_stack(tally, i, left, depth)
            depth -= 1
            node = stack[depth]
            add_to_packet(tally, BOXES, i, left, 1)
            enters = packet_enters(bounds, node, low, high, inverse, t_max)
            if mask_bits(enters & ~blocked) == 0:
                continue
            add_to_packet(tally, NODES, i, left, 1)
            child = bvh.child[node]
            if bvh.count[node] == 0:
                stack[depth] = child
                stack[depth + 1] = child + 1
                depth += 2
                continue
            end = child + bvh.count[node]
            blocked = blocked_by(
                primitives, child, end, origin, direction, t_max, blocked, tally, i, left
            )
        store_row(shadow_rays.blocked, 0, i, select(blocked, splat_i32(1), splat_i32(0)))


@method_kernel
def any_hit_bvh(bvh, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays, one ray at a time."""
    for i in range(count):
        if shadow_rays.blocked[i] != 0:
            continue
        origin = column(shadow_rays.origin, i)
        direction = column(shadow_rays.direction, i)
        if ray_is_blocked(bvh, origin, direction, shadow_rays.t_max[i], tally, i):
            shadow_rays.blocked[i] = 1


@kernel
def ray_is_blocked(bvh, origin, direction, t_max, tally, i):
    """Return whether one ray meets anything up to t_max.

    A traversal of its own: `nearest_of_ray`, ended by its first hit, takes 1.18 times as
    long, as it puts children in order (smooth-mesh, random rays).
    """
    bounds, primitives = bvh.bounds, bvh.primitives
    inverse = np.float32(1.0) / direction
    low, high = origin_margins(origin)
    stack = local_i32(STACK)
    stack[0] = 0
    depth = np.int64(1)
    while depth > 0:
        note_stack(tally, i, depth)
        depth -= 1
        node = np.int64(stack[depth])
        add_to(tally, BOXES, i, 1)
        if ray_enters(bounds, node, low, high, inverse, t_max) == _INFINITY:
            continue
        add_to(tally, NODES, i, 1)
        child = np.int64(bvh.child[node])
        if bvh.count[node] == 0:
            stack[depth] = child
            stack[depth + 1] = child + 1
            depth += 2
            continue
        end = child + bvh.count[node]
        if blocked_in_range(primitives, child, end, origin, direction, t_max, tally, i):
            return True
    return False
