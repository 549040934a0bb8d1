"""The nodes of a kd-tree between building and use: bad splits retracted, then laid out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.kd_tree.kd_tree_split import CHEAPEST, TRAVERSAL_COST, leaf_cost
from renderer.kernels.jit import entry_kernel

MAX_DEPTH = 60  # edges from the root to the deepest leaf; sizes traversal stacks
LEAF = 3  # in place of an axis


class KdNodes(NamedTuple):
    """Nodes in the order in which they were made, children after their parents."""

    axis: NDArray[np.int32]  # (nodes,) 0, 1, 2, or LEAF
    plane: NDArray[np.float32]  # (nodes,) coordinate of the split
    child: NDArray[np.int32]  # (nodes,) first of two adjacent children
    count: NDArray[np.int32]  # (nodes,) references in the cell
    share: NDArray[np.float64]  # (nodes,) of its parent's surface area
    # (nodes,) what the leaves below hold: items[begin:end]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]


def room_for(count: int) -> KdNodes:
    """Return room for so many nodes; nothing is written yet."""
    return KdNodes(
        np.empty(count, np.int32),
        np.empty(count, np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.int32),
        np.empty(count, np.float64),
        np.empty(count, np.int64),
        np.empty(count, np.int64),
    )


@entry_kernel
def retract(nodes, rule, cost):
    """Turn every node into a leaf whose subtree turned out to be no better than a leaf.

    `cost` has room for a number of each node.

    The estimate at a split took both parts for leaves; now their real costs are known. The
    other rules keep a subtree if any of its leaves holds less than the node did.
    """
    for node in range(len(nodes.axis) - 1, -1, -1):
        as_leaf = np.float64(nodes.count[node])
        if rule == CHEAPEST:
            as_leaf = leaf_cost(nodes.count[node])
        cost[node] = as_leaf
        if nodes.axis[node] == LEAF:
            continue
        child = nodes.child[node]
        nodes.end[node] = max(nodes.end[child], nodes.end[child + 1])
        as_split = min(cost[child], cost[child + 1])
        if rule == CHEAPEST:
            as_split = nodes.share[child] * cost[child] + TRAVERSAL_COST
            as_split += nodes.share[child + 1] * cost[child + 1]
        if as_split < as_leaf:
            cost[node] = as_split
        else:
            nodes.axis[node] = LEAF


def laid_out(
    nodes: KdNodes, items: NDArray[np.int32], n: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Return the tree in the order of a walk, near nodes near in memory.

    A retracted node takes what the leaves below it held, each of the n primitives once.
    """
    made = len(nodes.axis)
    out = np.empty((made, 2), np.int32)
    first, listed = np.empty(made + 1, np.int32), np.empty(len(items), np.int32)
    last_leaf = np.full(n, -1, np.int32)
    waiting = np.zeros((MAX_DEPTH + 2, 2), np.int64)
    planes = out.view(np.float32)
    placed, leaves, used = _lay_out(
        nodes, items, last_leaf, waiting, out, planes, first, listed
    )
    return out[:placed].copy(), first[: leaves + 1].copy(), listed[:used].copy()


@entry_kernel
def _lay_out(nodes, items, last_leaf, waiting, out, planes, first, listed):
    """Write nodes, where leaves begin, and their items; return how many of each.

    `waiting` is the nodes that wait, and their places; the root in its own is first.
    """
    top, placed = np.int64(1), np.int64(1)
    leaves, used = np.int64(0), np.int64(0)
    while top > 0:
        top -= 1
        node, place = waiting[top, 0], waiting[top, 1]
        axis = nodes.axis[node]
        if axis != LEAF:
            planes[place, 0] = nodes.plane[node]
            out[place, 1] = placed * 4 + axis
            waiting[top, 0] = nodes.child[node] + 1
            waiting[top, 1] = placed + 1
            waiting[top + 1, 0] = nodes.child[node]
            waiting[top + 1, 1] = placed
            top += 2
            placed += 2
            continue
        out[place, 0] = 0
        out[place, 1] = leaves * 4 + LEAF
        first[leaves] = used
        for j in range(nodes.begin[node], nodes.end[node]):
            k = items[j]
            if last_leaf[k] != leaves:
                last_leaf[k] = leaves
                listed[used] = k
                used += 1
        leaves += 1
    first[leaves] = used
    return placed, leaves, used
