"""What can be said of any kd-tree: whether it is sound, and what it costs.

The slow truth beside the builder: `validate_kd_arrays` says whether a traversal can miss
anything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.kd_tree.kd_tree_nodes import LEAF, MAX_DEPTH
from renderer.accelerators.kd_tree.kd_tree_split import BLOCK, BLOCK_COST, TRAVERSAL_COST
from renderer.accelerators.octree_and_bsp.cell_checks import (
    in_sorted,
    reaches_into,
    require_lists,
    require_none,
)
from renderer.plugins.shapes.extents import Extents

Cells = NDArray[np.float32]  # (nodes, 6)


def kd_cells(tree: Any) -> tuple[Cells, NDArray[np.int64]]:
    """Return the cell (nodes, 6) and the depth (nodes,) of each node of a sound tree."""
    axis, child = tree.link[1::2] & 3, tree.link[1::2] >> 2
    cells = np.empty((len(axis), 6), np.float32)
    depth = np.zeros(len(axis), np.int64)
    cells[0] = tree.bounds
    level = np.zeros(1, np.int64)
    while level.size:
        level = level[axis[level] != LEAF]
        side, below = axis[level], child[level].astype(np.int64)
        cells[below] = cells[below + 1] = cells[level]
        cells[below, side + 3] = cells[below + 1, side] = tree.split[2 * level]
        depth[below] = depth[below + 1] = depth[level] + 1
        level = np.concatenate((below, below + 1))
    return cells, depth


def kd_cost(tree: Any) -> float:
    """Return the cost C that the heuristic expects of a ray which meets the root's cell."""
    cells, _ = kd_cells(tree)
    a, b, c = (cells[:, 3:].astype(np.float64) - cells[:, :3]).T
    area = a * b + b * c + c * a
    share = area / area[0] if area[0] > 0 else np.ones_like(area)
    leaf = tree.link[1::2] & 3 == LEAF
    count = np.diff(tree.first)[tree.link[1::2][leaf] >> 2]
    cost = np.full(len(area), TRAVERSAL_COST)
    cost[leaf] = BLOCK_COST * -(-count // BLOCK)
    return float(np.sum(share * cost))


def validate_kd_arrays(tree: Any, extents: Extents) -> None:
    """Check that a tree is one and that each cell holds whatever reaches into it.

    Raises
    ------
    ValueError
        If not; the message says which node or leaf, and what is wrong with it.
    """
    _require_tree(tree)
    require_lists("kd-tree", tree, extents)
    cells, depth = kd_cells(tree)
    require_none(
        "kd-tree node", np.flatnonzero(depth > MAX_DEPTH), "is too deep for the stack"
    )
    axis, nodes = tree.link[1::2] & 3, np.arange(len(depth))
    inner = nodes[axis != LEAF]
    plane, side = tree.split[2 * inner], axis[inner]
    inside = (cells[inner, side] < plane) & (plane < cells[inner, side + 3])
    require_none("kd-tree node", inner[~inside], "has its plane outside of its cell")
    _require_held(tree, extents, cells)


def _require_tree(tree: Any) -> None:
    """Check that every node but the root is the child of exactly one earlier node."""
    if len(tree.split) != len(tree.link) or len(tree.link) % 2:
        raise ValueError(f"kd-tree: {len(tree.split)} splits, {len(tree.link)} links")
    axis, child = tree.link[1::2] & 3, tree.link[1::2].astype(np.int64) >> 2
    inner = np.flatnonzero(axis != LEAF)
    below = child[inner]
    require_none("kd-tree node", inner[below <= inner], "comes after its children")
    require_none(
        "kd-tree node", inner[below + 1 >= len(axis)], "has children that do not exist"
    )
    parents = np.bincount(np.concatenate((below, below + 1)), minlength=len(axis))
    wrong = np.flatnonzero(parents[1:] != 1) + 1
    require_none("kd-tree node", wrong, "is not the child of exactly one node")
    leaves = np.sort(child[axis == LEAF])
    if not np.array_equal(leaves, np.arange(len(tree.first) - 1)):
        raise ValueError("kd-tree leaves are not numbered 0, 1, 2, ...")


def _require_held(tree: Any, extents: Extents, cells: Cells) -> None:
    """Check that each leaf lists whatever reaches into its cell.

    All primitives go down the tree, each to wherever its box reaches.
    """
    n = extents.lower.shape[1]
    axis, child = tree.link[1::2] & 3, tree.link[1::2].astype(np.int64) >> 2
    leaf = np.repeat(np.arange(len(tree.first) - 1), np.diff(tree.first))
    listed = np.sort(leaf * n + tree.items)
    node, k = np.zeros(n, np.int64), np.arange(n)
    while node.size:
        at_leaf = axis[node] == LEAF
        key = child[node[at_leaf]] * n + k[at_leaf]
        missing = np.flatnonzero(at_leaf)[~in_sorted(key, listed)]
        cell = cells[node[missing]].astype(np.float64)
        reaches = reaches_into(extents, k[missing], cell[:, :3], cell[:, 3:])
        lost = missing[reaches]
        if lost.size:
            raise ValueError(
                f"kd-tree leaf at node {node[lost[0]]} does not list primitive "
                f"{k[lost[0]]} (of {lost.size} such)"
            )
        node, k = node[~at_leaf], k[~at_leaf]
        side, plane = axis[node], tree.split[2 * node]
        below = extents.lower[side, k] - extents.pad / 2 < plane
        above = extents.upper[side, k] + extents.pad / 2 > plane
        node = np.concatenate((child[node[below]], child[node[above]] + 1))
        k = np.concatenate((k[below], k[above]))
