"""Binary space partitioning: space is halved again and again by planes in any position.

The tree that games draw from back to front [Fuchs1980] is walked from front to back here:
a ray meets the half that it comes from first, the other half waits on a stack, and the
first hit that lies before all that waits ends the ray. Planes come from the polygons
(`bsp_build.py`); what lies on both sides of a plane is kept on both, whole.

Why single precision is safe: for an origin within `reach`, the rounded distances of a ray's
origin and direction to a plane misplace a point of the ray by less than 16 units in the
last place of `reach`, which is half a pad. The builder grows hulls by two pads.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.octree_and_bsp.bsp_build import (
    MARGIN,
    MAX_DEPTH,
    build_planes,
    require_nodes,
)
from renderer.accelerators.rays.ray_by_ray import trace_ray
from renderer.accelerators.rays.single_ray import hit_in_list, nearest_of_all
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.records.tally import BOXES, NODES, add_to, note_stack
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

STACK = 64  # the builder keeps the depth at 60 or below
PROVEN = 1.5  # pads that the traversal needs hulls to be grown by
# Directions of other lengths take the slow way, as origins beyond reach do.
SHORTEST, LONGEST = np.float32(1e-15), np.float32(1e15)
_INFINITY = np.float32(np.inf)


class Bsp(NamedTuple):
    """The tree's nodes and leaves; node 0 is the root."""

    plane: NDArray[np.float32]  # (nodes, 4) unit normal and offset: normal . x = offset
    child: NDArray[np.int32]  # (nodes,) inner: node behind, next: in front; leaf: see count
    # (nodes,) 0: inner; k > 0: leaf of items[child : child + k]
    count: NDArray[np.int32]  # type: ignore[assignment]  # tuple has a method count
    items: NDArray[np.int32]  # (references,) columns of `primitives`, leaf by leaf
    bounds: NDArray[np.float32]  # (6,) lower x y z, upper x y z of all, padded
    reach: np.float32  # origins with |x| + |y| + |z| beyond it take the slow way
    primitives: Any  # a group of one kind, in the scene's order


def build_bsp(extents: Extents, group: PrimitiveGroup) -> Bsp:
    """Build with the planes of polygons and of box faces."""
    tree = build_planes(extents)
    lower = extents.lower.min(axis=1) - MARGIN * extents.pad
    upper = extents.upper.max(axis=1) + MARGIN * extents.pad
    bounds = np.concatenate((lower, upper)).astype(np.float32)
    columns = np.arange(extents.lower.shape[1])
    return Bsp(*tree, bounds, np.float32(extents.reach), group(columns))


# ------------------------------------------------------------------------------ traversal


class Waiting(NamedTuple):
    """The halves that a ray meets later, the next one last."""

    stack: Any  # nodes
    enters: Any  # t where the ray enters each ...
    leaves: Any  # ... and leaves it
    depth: Any  # how many wait


@kernel
def _next(waiting):
    """Return the next node, where the ray enters and leaves it, and what still waits."""
    stack, enters, leaves, depth = waiting
    depth -= 1
    rest = Waiting(stack, enters, leaves, depth)
    return stack[depth], enters[depth], leaves[depth], rest


@kernel
def _is_ray(origin, direction):
    """Return whether all six numbers are finite, and the direction is not 0.

    Anything else hits nothing. x - x is NaN where x is not finite.
    """
    zero = (origin.x - origin.x) + (origin.y - origin.y) + (origin.z - origin.z)
    zero += (direction.x - direction.x) + (direction.y - direction.y)
    zero += direction.z - direction.z
    moves = direction.x != 0.0 or direction.y != 0.0 or direction.z != 0.0
    return moves and zero == 0.0


@kernel
def _within(origin, direction, reach):
    """Return whether a ray starts where the pads suffice, and no product leaves float32."""
    length = abs(direction.x) + abs(direction.y) + abs(direction.z)
    near = abs(origin.x) + abs(origin.y) + abs(origin.z) <= reach
    return near and SHORTEST < length < LONGEST


@kernel
def _clip(lower, upper, start, inverse, t_enter, t_leave):
    """Return the part of [t_enter, t_leave] between two parallel sides of a box.

    A ray in one of the planes gives 0 * inf = NaN, which leaves the interval as it is.
    """
    a = (lower - start) * inverse
    b = (upper - start) * inverse
    if a > b:
        a, b = b, a
    t_enter = a if a > t_enter else t_enter
    t_leave = b if b < t_leave else t_leave
    return t_enter, t_leave


@kernel
def _interval(bounds, origin, direction, t_max):
    """Return where a ray enters and leaves the box of all; enter > leave: never."""
    one = np.float32(1.0)
    t_enter, t_leave = _clip(
        bounds[0], bounds[3], origin.x, one / direction.x, np.float32(0.0), t_max
    )
    t_enter, t_leave = _clip(
        bounds[1], bounds[4], origin.y, one / direction.y, t_enter, t_leave
    )
    return _clip(bounds[2], bounds[5], origin.z, one / direction.z, t_enter, t_leave)


@kernel
def _crossing(plane, node, child, origin, direction):
    """Return where a ray crosses a node's plane, and the half that it comes from.

    A ray parallel to the plane never leaves its half. In the plane itself either half will
    do: what is so near the plane is in both.
    """
    x, y, z = plane[node, 0], plane[node, 1], plane[node, 2]
    away = x * origin.x + y * origin.y + z * origin.z - plane[node, 3]
    speed = x * direction.x + y * direction.y + z * direction.z
    if speed == 0.0:
        return _INFINITY, child + 1 if away > 0.0 else child
    return -away / speed, child + 1 if speed < 0.0 else child


@kernel
def _first_leaf(bsp, node, t_enter, t_leave, waiting, origin, direction, tally, i):
    """Return the first leaf that a ray meets below a node; what comes later waits."""
    stack, enters, leaves, depth = waiting
    add_to(tally, NODES, i, 1)
    while bsp.count[node] == 0:
        child = bsp.child[node]
        t, node = _crossing(bsp.plane, node, child, origin, direction)
        second = child + child + 1 - node
        add_to(tally, BOXES, i, 1)
        add_to(tally, NODES, i, 1)
        if t < t_enter:
            node = second
        elif t <= t_leave:
            stack[depth], enters[depth], leaves[depth] = second, t, t_leave
            depth += 1
            note_stack(tally, i, depth)
            t_leave = t
    return node, Waiting(stack, enters, leaves, depth)


@trace_ray.by(Bsp)
@kernel
def _trace_bsp(bsp, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""
    primitives, items = bsp.primitives, bsp.items
    if not _is_ray(origin, direction):
        return hit
    if not _within(origin, direction, bsp.reach):
        return nearest_of_all(primitives, origin, direction, hit, tally, i)
    waiting = Waiting(local_i32(STACK), local_f32(STACK), local_f32(STACK), np.int64(0))
    node = np.int64(0)
    t_enter, t_leave = _interval(bsp.bounds, origin, direction, hit.t)
    add_to(tally, BOXES, i, 1)
    while t_enter <= t_leave:
        node, waiting = _first_leaf(
            bsp, node, t_enter, t_leave, waiting, origin, direction, tally, i
        )
        start = bsp.child[node]
        end = start + bsp.count[node]
        hit = hit_in_list(
            primitives, items, start, end, origin, direction, hit, any_will_do, tally, i
        )
        if waiting.depth == 0 or (any_will_do != 0 and hit.prim >= 0):
            break
        node, t_enter, t_leave, waiting = _next(waiting)
        # all that waits begins here or later; at t_enter = hit.t there may be a tie
        t_leave = min(t_leave, hit.t)
    return hit


# -------------------------------------------------------------------------------- proof


def validate_bsp(bsp: Bsp, extents: Extents) -> None:
    """Check that a tree is one, and that no ray within reach can miss a primitive.

    Every primitive is sent down the tree once more, by its hull grown by as much as the
    traversal needs; each leaf that it comes to must name it.

    Raises
    ------
    ValueError
        If not; the message says which node, and what is wrong with it.
    """
    require_nodes(bsp, float(bsp.reach))
    n = extents.lower.shape[1]
    if not ((bsp.items >= 0) & (bsp.items < n)).all():
        raise ValueError(f"BSP items name primitives that are none of the {n}")
    low, high = extents.lower.min(axis=1), extents.upper.max(axis=1)
    below, above = low - extents.pad, high + extents.pad
    if not ((bsp.bounds[:3] <= below).all() and (bsp.bounds[3:] >= above).all()):
        raise ValueError("BSP bounds do not hold all boxes, padded")
    if not bsp.reach <= np.float32(extents.reach):
        raise ValueError(f"BSP reach {bsp.reach} is beyond that of the pads")

    grown = extents.radius.astype(np.float64) + PROVEN * extents.pad
    waiting = [(0, np.arange(n), 0)]
    held = np.zeros(n, bool)
    while waiting:
        node, arriving, depth = waiting.pop()
        if depth > MAX_DEPTH:
            raise ValueError(f"BSP node {node} is deeper than {MAX_DEPTH}")
        child = int(bsp.child[node])
        if bsp.count[node]:
            items = bsp.items[child : child + bsp.count[node]]
            held[items] = True
            missing = arriving[~held[arriving]]
            held[items] = False
            if missing.size:
                raise ValueError(
                    f"BSP leaf {node} lacks primitive {missing[0]}"
                    f" (of {missing.size} such) that reaches it"
                )
            continue
        normal, offset = bsp.plane[node, :3].astype(np.float64), bsp.plane[node, 3]
        away = np.einsum("a,apk->pk", normal, extents.points[:, :, arriving]) - offset
        behind = away.min(axis=0) - grown[arriving] <= 0.0
        in_front = away.max(axis=0) + grown[arriving] >= 0.0
        waiting.append((child, arriving[behind], depth + 1))
        waiting.append((child + 1, arriving[in_front], depth + 1))
