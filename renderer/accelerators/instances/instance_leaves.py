"""What the rays of a list meet in a leaf of a group: together, or ray by ray.

The primitives of a leaf are of one kind, by its place in `plugins.shapes.registry`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.streams.stream_leaves import (
    intersect_one_by_one,
    intersect_together,
)
from renderer.accelerators.instances.instance_boxes import SHORT
from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY
from renderer.kernels.lanes.memory import load_one
from renderer.kernels.records.tally import PRIMITIVES, add_to

# words of a leaf of primitives
FIRST = 0  # its first primitive
END = 1
KIND = 2  # which of the kinds of primitives, by its place in the registry
TOGETHER = 3  # leaves from this one on that are tested together, one of each kind
LEAF_WORDS = 4


class Primitives(NamedTuple):
    """The primitives of one kind in all groups, and those of the other kinds."""

    blocks: Any  # in blocks of eight, or None
    singles: Any  # not in blocks, or None
    others: Any  # `Primitives` of the next kind of the registry, or `NoMore`


class NoMore(NamedTuple):
    """The end of the list of kinds."""


def primitives_of(blocks: list[Any], singles: list[Any]) -> Any:
    """Return the record of all kinds, which are given in the order of the registry."""
    found: Any = NoMore()
    for k in reversed(range(len(blocks))):
        found = Primitives(blocks[k], singles[k], found)
    return found


def of_kind(primitives: Any, kind: int) -> Any:
    """Return the primitives of a kind, by its place in the registry."""
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
