"""Streams of rays through instances: a tree over the instances, one tree per group.

In a leaf of a group, rays are tested 16 at once or one by one. The primitives of a leaf
are of one kind, numbered as in `plugins.shapes.registry`.
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
from renderer.accelerators.bvh.streams.stream_leaves import (
    intersect_one_by_one,
    intersect_together,
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
from renderer.accelerators.instances.instance_rays import (
    SHORT,
    World,
    divide_by_middle,
    enter_instance,
    leave_instance,
)
from renderer.accelerators.rays.query import Query
from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import splat_i32
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.memory import load_one, store_row
from renderer.kernels.lanes.vectors import local_columns_f32, local_f32, local_i32
from renderer.kernels.records.batch import PRIMITIVES, add_to

# words of a leaf of primitives
FIRST = 0  # first primitive
END = 1
KIND = 2  # kind of primitive, as numbered in the registry
TOGETHER = 3  # end of the leaves tested together, one leaf per kind
LEAF_WORDS = 4


class Primitives(NamedTuple):
    """The primitives of one kind in all groups, linked to those of the other kinds."""

    blocks: Any  # the kind's blocks of eight, or None
    singles: Any  # the kind's single primitives, or None
    others: Any  # `Primitives` of the registry's next kind, or `NoMore`


class NoMore(NamedTuple):
    """The end of the list of kinds."""


def primitives_of(blocks: list[Any], singles: list[Any]) -> Any:
    """Return the linked record of all kinds, given in the order of the registry."""
    found: Any = NoMore()
    for k in reversed(range(len(blocks))):
        found = Primitives(blocks[k], singles[k], found)
    return found


def of_kind(primitives: Any, kind: int) -> Any:
    """Return the primitives of a kind, as numbered in the registry."""
    for _ in range(kind):
        primitives = primitives.others
    return primitives.singles if primitives.blocks is None else primitives.blocks


@kernel
def intersect_group_leaf(instances, leaf, query, stream, place, m, tally):
    """Test the rays of a list against the primitives of a leaf."""
    first = np.int64(load_one(instances.leaves, 0, leaf + FIRST))
    end = np.int64(load_one(instances.leaves, 0, leaf + END))
    kind = np.int64(load_one(instances.leaves, 0, leaf + KIND))
    rays, lists = stream.rays, stream.lists
    if tally is not None:
        for j in range(place, place + m):
            add_to(tally, PRIMITIVES, stream.counted[lists[j]], end - first)
    _intersect_kind(instances.primitives, kind, first, end, query, rays, lists, place, m)


@interface
def _intersect_kind(primitives, kind, first, end, query, rays, lists, place, m):
    """Test the rays of a list against primitives first to end - 1 of a kind."""


@_intersect_kind.by(Primitives)
@kernel
def _in_kind(primitives, kind, first, end, query, rays, lists, place, m):
    if kind == 0:
        _in_blocks(primitives.blocks, first, end, query, rays, lists, place, m)
        _in_singles(primitives.singles, first, end, query, rays, lists, place, m)
    else:
        others = primitives.others
        _intersect_kind(others, kind - 1, first, end, query, rays, lists, place, m)


@_intersect_kind.by(NoMore)
@kernel
def _in_none(primitives, kind, first, end, query, rays, lists, place, m):
    pass


@kernel
def _in_blocks(blocks, first, end, query, rays, lists, place, m):
    if blocks is None:
        return
    if m > SHORT and not HAS_AVX2_ONLY:
        intersect_together(blocks, first, end, query, rays, lists, place, m)
        return
    start, stop = first >> 3, (end + 7) >> 3
    intersect_one_by_one(blocks, start, stop, query, rays, lists, place, m, None)


@kernel
def _in_singles(primitives, first, end, query, rays, lists, place, m):
    if primitives is not None:
        intersect_together(primitives, first, end, query, rays, lists, place, m)


# --------------------------------------------------------------------- instance streams
# Streams through instances: all rays of a batch traverse both levels of trees together.
#
# A leaf of the tree over instances is an instance. The list's rays are transformed into
# its object space, and the new list traverses the group's own tree.
#
# Lists are not divided by octant. The octant of a ray changes from instance to instance,
# and the lists would be short: of scenes/instances' bounce rays 47 stay together at an
# instance by octants, 186 without (docs/performance.md, "Streams").

# Levels of both trees, and three more where the trees of a group's kinds are joined.
_LEVELS = 2 * (MAX_DEPTH + 4)
_LISTS = _LEVELS * LEVEL
_STACK = WAITING_WORDS * 8 * _LEVELS


class Group(NamedTuple):
    """The tree of a group, as traversed by the guests of an instance."""

    instances: Any


@kernel
def trace_instances(instances, query, first, count, tally):
    """Answer a query for rays first to first + count - 1, after all other structures."""
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
            # rays from beyond the reach of the padding visit every instance
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
