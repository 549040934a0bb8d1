"""Build a binary tree of boxes by one of three split rules.

`sah`, the surface area heuristic in 16 bins [Wald2007]: a ray that hits a box hits a
convex part of it with a probability of the ratio of their surface areas. So splitting a
node P into L and R is expected to cost

    C = C_trav + A_L/A_P C_leaf(n_L) + A_R/A_P C_leaf(n_R)

The split with the least C is taken. Candidates are the borders between 16 equal bins of
the box centres, along all three axes. A leaf is tested `BLOCK` primitives at a time, so
its cost grows in steps.

`median`: half of the primitives go to each side. `middle`: split the longest side of the
centres' box in the middle.

Parts of more than `JOB` primitives are split one by one; the rest is built on all cores,
without recursion. The tree does not depend on the number of threads.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.accelerators.bvh.bvh_split import BINS, MAX_DEPTH, enclose, split
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost, bvh_depth, validate_bvh
from renderer.kernels.jit import entry_kernel, kernel
from renderer.process.worker_pool import default_threads, in_parts, in_threads

__all__ = ["MAX_DEPTH", "BvhTree", "build_tree", "bvh_cost", "bvh_depth", "validate_bvh"]

JOB = 16384  # largest part that one thread builds alone
RULES = ("sah", "median", "middle")  # in the order of SAH, MEDIAN, MIDDLE


def build_tree(
    lower: ArrayLike, upper: ArrayLike, leaf_size: int = 8, rule: str = "sah"
) -> BvhTree:
    """Build the tree over axis-aligned boxes.

    Parameters
    ----------
    lower, upper : array_like of float32, shape (3, n)
        Opposite corners of the primitives' boxes, n >= 1, all finite.
        Largest number of primitives in a leaf.
    rule : str
        One of `RULES`.

    Raises
    ------
    ValueError
        If the arrays do not have the same shape (3, n), or n is 0.
    """
    low = np.ascontiguousarray(lower, np.float32)
    high = np.ascontiguousarray(upper, np.float32)
    if low.shape != high.shape or low.ndim != 2 or low.shape[0] != 3 or low.size == 0:
        raise ValueError(f"boxes need two (3, n) arrays: {low.shape} and {high.shape}")
    if leaf_size < 1:
        raise ValueError(f"leaf_size is at least 1: {leaf_size}")
    boxes = side_by_side(low, high)
    order = np.arange(len(boxes), dtype=np.int32)
    settings = (leaf_size, RULES.index(rule))
    bounds, child, count = _build_in_jobs(boxes, order, settings)
    return BvhTree(bounds, child, count, order)


def side_by_side(low: NDArray[np.float32], high: NDArray[np.float32]) -> Any:
    """Return `boxes` of `bvh_split` from lower and upper corners (3, n)."""
    boxes = np.zeros((low.shape[1], 8), np.float32)
    in_parts(len(boxes), _put_side_by_side, low, high, boxes)
    return boxes


@entry_kernel
def _put_side_by_side(begin, end, low, high, boxes):
    for k in range(begin, end):
        for axis in range(3):
            boxes[k, axis], boxes[k, axis + 4] = low[axis, k], -high[axis, k]


# ----------------------------------------------------------------------- parallel build


def _build_in_jobs(boxes: Any, order: Any, settings: tuple[int, int]) -> Any:
    """Split the large parts, build the rest in parallel, and assemble all nodes."""
    n = len(order)
    job = max(JOB, settings[0])  # a part that fits a leaf is not split
    if n <= job:
        return _build(boxes, order, 0, n, 0, *settings)
    children: dict[int, tuple[Any, int, int]] = {}  # part -> its box, left part, right part
    subtrees: dict[int, Any] = {}
    parts = [(0, n, 0)]  # first, end, depth of each; the root is part 0
    small: list[int] = []
    large, found = [0], {}

    def split_part(k: int) -> None:
        first, end, depth = parts[large[k]]
        found[large[k]] = _split_once(boxes, order, first, end, depth, *settings)

    while large:  # breadth-first
        in_threads(default_threads(), len(large), split_part)
        halves = []
        for part in large:
            first, end, depth = parts[part]
            box, middle = found[part]
            left = len(parts)
            children[part] = (box, left, left + 1)
            parts += [(first, middle, depth + 1), (middle, end, depth + 1)]
            halves += [left, left + 1]
        large = [part for part in halves if parts[part][1] - parts[part][0] > job]
        small += [part for part in halves if parts[part][1] - parts[part][0] <= job]

    def build(k: int) -> None:
        first, end, depth = parts[small[k]]
        subtrees[small[k]] = _build(boxes, order, first, end, depth, *settings)

    in_threads(default_threads(), len(small), build)
    return _assemble(children, subtrees)


def _assemble(children: dict[int, tuple[Any, int, int]], subtrees: dict[int, Any]) -> Any:
    """Put the nodes of the large parts first, then subtree after subtree."""
    top: list[tuple[int, int]] = [(0, 0)]  # part and its node
    leaves: list[tuple[int, int]] = []
    nodes = 1
    head_bounds: list[Any] = [None]
    head_child, head_count = [0], [0]
    while top:
        part, node = top.pop()
        if part in subtrees:
            leaves.append((part, node))
            continue
        box, left, right = children[part]
        head_bounds[node] = box
        head_child[node] = nodes
        head_bounds += [None, None]
        head_child += [0, 0]
        head_count += [0, 0]
        top += [(right, nodes + 1), (left, nodes)]
        nodes += 2
    bounds: list[Any] = []
    child: list[Any] = []
    count: list[Any] = []
    for part, node in leaves:
        b, c, k = subtrees[part]
        # the subtree's root takes its place in `top`, the other nodes follow
        shifted = np.where(k == 0, c + (nodes - 1), c)
        head_bounds[node], head_child[node], head_count[node] = b[0], shifted[0], k[0]
        bounds.append(b[1:])
        child.append(shifted[1:])
        count.append(k[1:])
        nodes += len(k) - 1
    return (
        np.concatenate([np.array(head_bounds, np.float32), *bounds]),
        np.concatenate([np.array(head_child), *child]).astype(np.int32),
        np.concatenate([np.array(head_count, np.int32), *count]),
    )


# ------------------------------------------------------------------------------ the build


class _Scratch(NamedTuple):
    """Scratch arrays of one job, made in Python: compiling the allocation takes seconds."""

    centres: NDArray[np.float32]  # (6,) box of the box centres
    bins: NDArray[np.float32]  # (3 BINS, 8) box of each bin, as in `bvh_split`
    counts: NDArray[np.int32]  # (3 BINS,)
    right_cost: NDArray[np.float64]  # (BINS,)
    constants: NDArray[np.float32]  # (2, 8) a row of -0.0 and one of infinity
    stack: NDArray[np.int64]  # (levels, 4) per waiting node: node, first, end, depth


def _scratch() -> _Scratch:
    return _Scratch(
        np.empty(6, np.float32),
        np.empty((3 * BINS, 8), np.float32),
        np.empty(3 * BINS, np.int32),
        np.empty(BINS, np.float64),
        np.repeat(np.float32([[-0.0], [np.inf]]), 8, axis=1),
        np.empty((MAX_DEPTH + 2, 4), np.int64),
    )


def _split_once(boxes: Any, order: Any, first: int, *rest: int) -> Any:
    """Split primitives first .. end - 1; return their box and the right part's begin."""
    box = np.empty(6, np.float32)
    return box, _split_node(boxes, order, first, *rest, box, _scratch())


@entry_kernel
def _split_node(boxes, order, first, end, depth, leaf_size, rule, box, scratch):
    enclose(boxes, first, end, box, scratch.centres)
    return split(boxes, order, first, end, depth, leaf_size, rule, box, scratch)


def _build(boxes: Any, order: Any, start: int, stop: int, *rest: int) -> Any:
    """Build over primitives start .. stop - 1; permutes `boxes` and `order`.

    Returns bounds, child and count; node 0 is the root.
    """
    most = 2 * (stop - start) - 1
    bounds = np.empty((most, 6), np.float32)
    child, count = np.empty(most, np.int32), np.zeros(most, np.int32)
    nodes = _build_nodes(boxes, order, start, stop, *rest, bounds, child, count, _scratch())
    return bounds[:nodes].copy(), child[:nodes].copy(), count[:nodes].copy()


@kernel
def _push(stack, top, node, first, end, depth):
    stack[top, 0] = node
    stack[top, 1] = first
    stack[top, 2] = end
    stack[top, 3] = depth
    return top + 1


@entry_kernel
def _build_nodes(
    boxes, order, start, stop, start_depth, leaf_size, rule, bounds, child, count, scratch
):
    """Write the nodes; return how many."""
    stack = scratch.stack
    top = _push(stack, np.int64(0), np.int64(0), start, stop, start_depth)
    nodes = np.int64(1)
    while top > 0:
        top -= 1
        node, first = stack[top, 0], stack[top, 1]
        end, depth = stack[top, 2], stack[top, 3]
        enclose(boxes, first, end, bounds[node], scratch.centres)
        middle = split(
            boxes, order, first, end, depth, leaf_size, rule, bounds[node], scratch
        )
        if middle == first:
            child[node] = first
            count[node] = end - first
            continue
        child[node] = nodes
        top = _push(stack, top, nodes + 1, middle, end, depth + 1)
        top = _push(stack, top, nodes, first, middle, depth + 1)
        nodes += 2
    return nodes
