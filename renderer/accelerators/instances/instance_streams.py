"""Streams through instances: all rays of a batch go down both levels of trees together.

A leaf of the tree over the instances is an instance: the rays of the list are written once
more as they are seen from there, and that list goes down the group's own tree.

The rays of one list go to all sides here. Which octant one belongs to changes from instance
to instance, and lists by octants would be short: of scenes/instances' bounce rays 47 stay
together at an instance by octants, 186 without (docs/performance.md, "Streams").
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
    visit,
)
from renderer.accelerators.bvh.wide.octants import (
    AFAR,
    ROW,
    STREAM,
    StreamRays,
    lay_out,
    select_octant,
    write_octants,
)
from renderer.accelerators.instances.instance_boxes import divide_by_middle
from renderer.accelerators.instances.instance_leaves import (
    LEAF_WORDS,
    TOGETHER,
    intersect_group_leaf,
)
from renderer.accelerators.instances.instance_rays import (
    World,
    enter_instance,
    leave_instance,
)
from renderer.accelerators.rays.query import Query
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_i32
from renderer.kernels.lanes.local import local_columns_f32, local_f32, local_i32
from renderer.kernels.lanes.memory import load_one, store_row

# Levels of both trees; three more than one tree has, where a group's kinds are joined.
_LEVELS = 2 * (MAX_DEPTH + 4)
_LISTS = _LEVELS * LEVEL
_STACK = WAITING_WORDS * 8 * _LEVELS


class Group(NamedTuple):
    """The tree of a group, as the guests of an instance go down it."""

    instances: Any


@kernel
def trace_instances(instances, query, first, count, tally):
    """Answer a query for rays first to first + count - 1; the last structure to do so."""
    if query.any_hit == 0:
        for i in range(first, first + count, 16):
            store_row(query.instance, 0, i, splat_i32(-1))
    octants, number, host = local_i32(ROW), local_i32(ROW), local_i32(ROW)
    lists, stack = local_i32(_LISTS), local_i32(_STACK)
    planes, entered = local_f32(48), local_i32(16)
    rays = StreamRays(number, local_columns_f32(8, ROW), local_columns_f32(8, ROW))
    stream = Stream(rays, number, lists, stack, planes, entered)

    places, counted, prim = local_i32(ROW), local_i32(ROW), local_i32(ROW)
    ends, u, v = local_f32(ROW), local_f32(ROW), local_f32(ROW)
    inside = StreamRays(places, local_columns_f32(8, ROW), local_columns_f32(8, ROW))
    guests = Stream(inside, counted, lists, stack, planes, entered)
    found = Query(None, None, ends, prim, u, v, None, query.any_hit)
    world = World(instances, guests, found, host)

    zero = np.int64(0)
    list_all(places, zero, ROW)
    size = instances.placements.group.shape[0]
    for begin in range(first, first + count, STREAM):
        end = min(begin + STREAM, first + count)
        write_octants(query, begin, end, np.float32(instances.reach), False, octants)
        for beyond in range(2):
            n = select_octant(begin, end, AFAR * beyond, octants, rays)
            if n == 0:
                continue
            lay_out(query, rays, n)
            # from beyond the reach that boxes are padded for: to every instance
            for k in range(size if beyond != 0 else 1):
                start = np.int64(~k if beyond != 0 else 0)
                list_all(lists, zero, n)
                descend(world, query, stream, start, zero, n, zero, tally)


@visit.by(World)
@kernel
def _visit_world(world, query, stream, node, place, m, depth, tally):
    instances = world.instances
    if node >= 0:
        depth = divide_by_middle(instances, node, stream, place, m, depth)
        add_nodes(tally, stream, place, m, depth)
        return depth
    k = ~node
    n = enter_instance(world, k, stream, place, m, tally)
    if n > 0:
        root = np.int64(load_one(instances.root, 0, k))
        behind = (place + m + 15) & ~15
        list_all(stream.lists, behind, n)
        group, guests = Group(instances), world.guests
        descend(group, world.found, guests, root, behind, n, depth, tally)
        leave_instance(world, query, k, stream.rays, n)
    return depth


@visit.by(Group)
@kernel
def _visit_group(group, query, stream, node, place, m, depth, tally):
    instances = group.instances
    if node >= 0:
        depth = divide_by_middle(instances, node, stream, place, m, depth)
        add_nodes(tally, stream, place, m, depth)
        return depth
    size = np.int64(instances.placements.group.shape[0])
    leaf = LEAF_WORDS * (~node - size)
    end = leaf + LEAF_WORDS * load_one(instances.leaves, 0, leaf + TOGETHER)
    for at in range(leaf, end, LEAF_WORDS):
        intersect_group_leaf(instances, at, query, stream, place, m, tally)
    return depth


descend.by(World, Group)(descend_tree)
