"""The arrays of a binary tree of boxes, and properties of any such tree.

`validate_bvh` proves that a traversal cannot miss a primitive, however the tree was built.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCK = 8  # primitives that are tested at once in a leaf
TRAVERSAL_COST = 1.0  # of visiting an inner node
BLOCK_COST = 1.0  # of testing one block of primitives, on the same scale


class BvhTree(NamedTuple):
    """A binary tree of boxes over n primitives; node 0 is the root."""

    bounds: NDArray[np.float32]  # (nodes, 6) smallest x, y, z, then largest x, y, z
    child: NDArray[np.int32]  # (nodes,) inner: first of two adjacent nodes; leaf: see count
    # (nodes,) 0: inner; k > 0: leaf of order[child : child + k]
    count: NDArray[np.int32]  # type: ignore[assignment]  # tuple has a method count
    order: NDArray[np.int32]  # (n,) the primitives, leaf by leaf


def bvh_depth(tree: BvhTree) -> int:
    """Return the number of edges from the root to the deepest leaf."""
    depth = 0
    level = np.zeros(1, np.int64)
    while True:
        first = tree.child[level[tree.count[level] == 0]]
        if first.size == 0:
            return depth
        level = np.concatenate((first, first + 1))
        depth += 1


def bvh_cost(tree: BvhTree) -> float:
    """Return the SAH cost C of a ray that hits the root's box.

    If the root has no area (points on a line), every box counts as hit.
    """
    extent = tree.bounds[:, 3:].astype(np.float64) - tree.bounds[:, :3]
    a, b, c = extent.T
    area = a * b + b * c + c * a
    share = area / area[0] if area[0] > 0 else np.ones_like(area)
    blocks = -(-tree.count // BLOCK)
    cost = np.where(tree.count == 0, TRAVERSAL_COST, BLOCK_COST * blocks)
    return float(np.sum(share * cost))


def validate_bvh(tree: BvhTree, lower: ArrayLike, upper: ArrayLike) -> None:
    """Check that the arrays form a tree over all primitives, each in its leaf's box.

    Parameters
    ----------
    lower, upper : array_like of float32, shape (3, n)
        The boxes that the tree was built over.

    Raises
    ------
    ValueError
        Otherwise. The message names the node or primitive and the fault.
    """
    low, high = np.asarray(lower, np.float32).T, np.asarray(upper, np.float32).T
    _require_tree(tree)
    _require_partition(tree, len(low))

    boxes = np.concatenate((low, -high), axis=1)[tree.order]  # minima bound both corners
    bounds = tree.bounds * np.repeat(np.array([1, -1], np.float32), 3)
    leaves = np.flatnonzero(tree.count)
    leaves = leaves[np.argsort(tree.child[leaves])]
    held = np.minimum.reduceat(boxes, tree.child[leaves])
    _require_none(leaves[~(bounds[leaves] <= held).all(axis=1)], "does not hold its boxes")
    inner = np.flatnonzero(tree.count == 0)
    held = np.minimum(bounds[tree.child[inner]], bounds[tree.child[inner] + 1])
    _require_none(inner[~(bounds[inner] <= held).all(axis=1)], "does not hold its children")


def _require_none(nodes: NDArray[np.int64], fault: str) -> None:
    if nodes.size:
        raise ValueError(f"BVH node {nodes[0]} (of {nodes.size} such) {fault}")


def _require_tree(tree: BvhTree) -> None:
    """Check that every node but the root is the child of exactly one earlier node."""
    nodes = len(tree.child)
    if not nodes == len(tree.count) == len(tree.bounds):
        raise ValueError(
            f"BVH arrays differ in length: {len(tree.bounds)} bounds, "
            f"{nodes} child, {len(tree.count)} count"
        )
    inner = np.flatnonzero(tree.count == 0)
    first = tree.child[inner].astype(np.int64)
    _require_none(inner[first <= inner], "comes after its children")
    _require_none(inner[first + 1 >= nodes], "has children that do not exist")
    parents = np.bincount(np.concatenate((first, first + 1)), minlength=nodes)
    wrong = np.flatnonzero(parents[1:] != 1) + 1
    _require_none(wrong, "is not the child of exactly one node")


def _require_partition(tree: BvhTree, n: int) -> None:
    """Check that each primitive is in exactly one leaf."""
    if not np.array_equal(np.sort(tree.order), np.arange(n)):
        raise ValueError(f"BVH order is not a permutation of {n} primitives")
    leaves = np.flatnonzero(tree.count)
    leaves = leaves[np.argsort(tree.child[leaves], kind="stable")]
    ends = np.cumsum(tree.count[leaves])
    starts = ends - tree.count[leaves]
    _require_none(leaves[tree.child[leaves] != starts], "leaves a gap or overlap in order")
    if ends.size == 0 or ends[-1] != n:
        raise ValueError(f"BVH leaves do not end with the last of {n} primitives")
