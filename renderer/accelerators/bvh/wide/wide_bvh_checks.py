"""Checks of the wide BVH: its nodes of eight children and its binary tree of blocks.

Each must reach every block of primitives once, through boxes that contain it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.accelerators.bvh.bvh_tree import BvhTree, validate_bvh
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    BOX_BYTES,
    CHILD,
    ORIGIN,
    PAIR_CHILD,
    PAIR_WORDS,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.plugins.shapes.blocks import WIDTH
from renderer.plugins.shapes.extents import Extents


def validate_wide(accel: Any, extents: Extents) -> None:
    """Check that both trees reach every block once, in boxes that enclose their contents.

    Parameters
    ----------
    accel
        A `WideBvh`.
    extents
        The primitive boxes that it was built over.

    Raises
    ------
    ValueError
        Otherwise; the message says which tree, node and block or primitive.
    """
    lower, upper = _boxes_in_blocks(accel.blocks, extents)
    validate_wide_nodes(accel.octets, lower.min(axis=1), upper.max(axis=1))
    _validate_orders(accel.integers, accel.order)
    _validate_pairs(accel.pairs, accel.blocks, extents)
    boxes = accel.boxes.reshape(-1, 6, WIDTH).swapaxes(1, 2)
    if not np.array_equal(boxes, np.concatenate((lower, upper), axis=2)):
        raise ValueError("a block of the wide tree has boxes of other primitives")
    _validate_ways_across(accel)


def _columns_of(ids: Any, n: int) -> Any:
    """Return the column of each primitive id; check that each appears once."""
    if len(ids) != n or len(np.unique(ids)) != n:
        raise ValueError(f"blocks hold {len(np.unique(ids))} of {n} primitives once")
    return np.searchsorted(np.sort(ids), ids)


def _boxes_in_blocks(blocks: Any, extents: Extents) -> tuple[Any, Any]:
    """Return the (blocks, 8, 3) corners of primitives; unused slots have inverted boxes."""
    filled = blocks.id >= 0
    column = _columns_of(blocks.id[filled], extents.lower.shape[1])
    lower = np.full((len(filled), 3), np.inf, np.float32)
    upper = -lower
    lower[filled], upper[filled] = extents.lower.T[column], extents.upper.T[column]
    return lower.reshape(-1, WIDTH, 3), upper.reshape(-1, WIDTH, 3)


def validate_wide_nodes(octets: Any, lower: Any, upper: Any) -> None:
    """Check that nodes of eight reach every leaf once, through boxes that enclose it.

    Parameters
    ----------
    octets
        The nodes, as bytes; the root is the first.
    lower, upper
        (n, 3) corners of the leaves.

    Raises
    ------
    ValueError
        Otherwise; the message says which node or leaf.
    """
    nodes = octets.reshape(-1, WIDE_BYTES)
    floats, integers = nodes.view(np.float32), nodes.view(np.int32)
    origin, unit = floats[:, ORIGIN : ORIGIN + 3, None], floats[:, SCALE : SCALE + 3, None]
    stored = nodes[:, BOX_BYTES:].reshape(len(nodes), 3, 3, 8).astype(np.float64)
    if not np.array_equal(stored[:, :, 0], stored[:, :, 2]):
        raise ValueError("wide node: the two copies of the lower bounds differ")
    low, high = (origin + unit * stored[:, :, k] for k in (0, 1))
    children = integers[:, CHILD : CHILD + 8]
    _require_once("wide node", children[children > 0], 1, len(nodes))
    _require_once("block of the wide tree", ~children[children < 0], 0, len(lower))

    held_low = np.full((len(nodes), 3), np.inf)
    held_high = -held_low
    for node in range(len(nodes) - 1, -1, -1):  # children have larger indices than parents
        for k in np.flatnonzero(children[node]):
            c = children[node, k]
            if c > 0 and c <= node:
                raise ValueError(f"wide node {c} comes before its parent {node}")
            a, b = (held_low[c], held_high[c]) if c > 0 else (lower[~c], upper[~c])
            if (low[node, :, k] > a).any() or (high[node, :, k] < b).any():
                raise ValueError(f"wide node {node}: box {k} does not hold its contents")
            held_low[node] = np.minimum(held_low[node], a)
            held_high[node] = np.maximum(held_high[node], b)


def _validate_ways_across(accel: Any) -> None:
    """Check that a wide node and the pair node it refers to hold the same blocks."""
    children = accel.integers.reshape(-1, WIDE_WORDS)[:, CHILD : CHILD + 8]
    links = accel.pairs.integers.reshape(-1, PAIR_WORDS)[:, PAIR_CHILD:]
    across = accel.pair_of.reshape(-1, 8)

    def blocks_below(pair: int) -> set[int]:
        child, count = (int(k) for k in links[pair])
        if count > 0:
            return {child // WIDTH}
        return blocks_below(child) | blocks_below(child + 1)

    held: dict[int, set[int]] = {}
    for node in range(len(children) - 1, -1, -1):  # children come after their parents
        held[node] = set()
        for c, pair in zip(children[node], across[node], strict=True):
            if c == 0:
                continue
            below = {~int(c)} if c < 0 else held[int(c)]
            if blocks_below(int(pair)) != below:
                raise ValueError(f"wide node {node}: its pairs hold other blocks")
            held[node] |= below


def _validate_orders(integers: Any, order: Any) -> None:
    """Check that the order for each octant names each child once."""
    here = integers.reshape(-1, WIDE_WORDS)[:, CHILD : CHILD + 8] != 0
    size = here.sum(axis=1)
    named = (order.reshape(-1, 8, 1) >> (4 * np.arange(8))) & 15
    named = np.where(np.arange(8) < size[:, None, None], named, 8)
    wanted = np.sort(np.where(here, np.arange(8), 8), axis=1)
    wrong = np.argwhere(np.sort(named, axis=2) != wanted[:, None])
    if wrong.size:
        node, octant, _ = wrong[0]
        raise ValueError(
            f"wide node {node}: the order of octant {octant} names not each child once"
        )


def _validate_pairs(pairs: Any, blocks: Any, extents: Extents) -> None:
    """Check the pairs as a binary tree whose leaves are blocks."""
    used = np.arange(len(pairs.floats) // PAIR_WORDS) != 1  # the root is alone in its pair
    boxes = pairs.floats.reshape(-1, PAIR_WORDS)[used, :PAIR_CHILD]
    child, count = pairs.integers.reshape(-1, PAIR_WORDS)[used, PAIR_CHILD:].T
    leaf = count > 0
    if (child[leaf] % WIDTH != 0).any():
        raise ValueError("a leaf of the pairs does not begin with a block")
    filled = blocks.id >= 0
    before = np.cumsum(filled) - filled  # primitives before each slot of the blocks
    first = np.where(leaf, before.take(child, mode="clip"), child - 1)
    order = _columns_of(blocks.id[filled], extents.lower.shape[1])
    tree = BvhTree(boxes, first, np.where(leaf, count, 0), order)
    try:
        validate_bvh(tree, extents.lower, extents.upper)
    except ValueError as error:
        raise ValueError(f"pairs: {error}") from None


def _require_once(what: str, found: Any, first: int, end: int) -> None:
    """Check that `found` holds each number first .. end - 1 exactly once."""
    numbers, times = np.unique(found, return_counts=True)
    wrong = np.setxor1d(numbers[times == 1], np.arange(first, end))
    if wrong.size:
        reached = np.count_nonzero(found == wrong[0])
        raise ValueError(f"{what} {wrong[0]} is reached {reached} times, not once")
