"""Bounding volume hierarchy by the surface area heuristic, in 16 bins [Wald2007].

A ray that meets a box meets a convex part of it with a probability of the ratio of their
surface areas. So splitting a node P into L and R is expected to cost

    C = C_trav + A_L/A_P C_leaf(n_L) + A_R/A_P C_leaf(n_R)

and the split with the least C is taken. Candidates are the borders between 16 equal
bins that the box centres of a node fall into, along all three axes. A leaf is tested
`BLOCK` primitives at a time, so its cost grows in steps.

The builder is one thread, without recursion, and always builds the same tree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from renderer.accelerators.bvh_tree import (
    BLOCK,
    BLOCK_COST,
    TRAVERSAL_COST,
    BvhTree,
    bvh_cost,
    bvh_depth,
    validate_bvh,
)
from renderer.jit import builder_kernel, kernel
from renderer.lanes.local import local_f32

__all__ = ["MAX_DEPTH", "BvhTree", "build_tree", "bvh_cost", "bvh_depth", "validate_bvh"]

BINS = 16
MAX_DEPTH = 60  # edges from the root to the deepest leaf; sizes traversal stacks

_INF = np.float32(np.inf)


def build_tree(lower: ArrayLike, upper: ArrayLike, leaf_size: int = 8) -> BvhTree:
    """Build the tree over axis-aligned boxes.

    Parameters
    ----------
    lower, upper : array_like of float32, shape (3, n)
        Opposite corners of the primitives' boxes, n >= 1, all finite.
    leaf_size : int
        Most primitives of a leaf.

    Raises
    ------
    ValueError
        If the arrays do not have the same shape (3, n), or there is nothing to build.
    """
    low = np.asarray(lower, np.float32)
    high = np.asarray(upper, np.float32)
    if low.shape != high.shape or low.ndim != 2 or low.shape[0] != 3 or low.size == 0:
        raise ValueError(f"boxes need two (3, n) arrays: {low.shape} and {high.shape}")
    if leaf_size < 1:
        raise ValueError(f"leaf_size is at least 1: {leaf_size}")
    boxes = np.concatenate((low, high)).T.copy()  # a box's six numbers side by side
    order = np.arange(len(boxes), dtype=np.int32)
    nodes, bounds, child, count = _build(boxes, order, leaf_size)
    return BvhTree(bounds[:nodes].copy(), child[:nodes].copy(), count[:nodes].copy(), order)


# ------------------------------------------------------------------------------ the build


@builder_kernel
def _build(boxes, order, leaf_size):
    """Build the tree; permutes `boxes` and `order` alike."""
    n = len(order)
    bounds = np.empty((2 * n - 1, 6), np.float32)
    child = np.empty(2 * n - 1, np.int32)
    count = np.zeros(2 * n - 1, np.int32)
    centres = np.empty(6, np.float32)
    bin_bounds = np.empty((3, BINS, 6), np.float32)
    bin_counts = np.empty((3, BINS), np.int32)
    right_cost = np.empty(BINS, np.float64)

    # one waiting node for each level: (node, first, end, depth)
    stack = np.empty((MAX_DEPTH + 2, 4), np.int64)
    stack[0] = (0, 0, n, 0)
    top = 1
    nodes = 1
    while top > 0:
        top -= 1
        node, first, end, depth = stack[top]
        size = end - first
        _enclose(boxes, first, end, bounds[node], centres)

        # choose: leaf or split
        middle = first
        if size > 1 and _levels_for(size) + depth < MAX_DEPTH:
            _fill_bins(boxes, first, end, centres, bin_bounds, bin_counts)
            cost, axis, border = _cheapest_split(
                bounds[node], bin_bounds, bin_counts, right_cost
            )
            if size > leaf_size or cost < BLOCK_COST * _blocks(size):
                middle = _partition(boxes, order, first, end, centres, axis, border)
        if middle == first:
            if size <= leaf_size:
                child[node] = first
                count[node] = size
                continue
            # no border separates the centres, or the tree grows too deep
            middle = first + size // 2
            _split_at_median(boxes, order, first, end, middle, centres)

        child[node] = nodes
        stack[top] = (nodes + 1, middle, end, depth + 1)
        stack[top + 1] = (nodes, first, middle, depth + 1)
        top += 2
        nodes += 2
    return nodes, bounds, child, count


@kernel
def _levels_for(size):
    """Return the levels that halving needs to reach single primitives."""
    levels = 0
    while (1 << levels) < size:
        levels += 1
    return levels


@kernel
def _blocks(size):
    """Return how many blocks a leaf of `size` primitives fills."""
    return (size + BLOCK - 1) // BLOCK


@kernel
def _centre(boxes, i, axis):
    """Return the middle of a box; halved first, so that it cannot overflow."""
    return np.float32(0.5) * boxes[i, axis] + np.float32(0.5) * boxes[i, axis + 3]


@kernel
def _enclose(boxes, first, end, bounds, centres):
    """Write the box of the boxes, and of their centres."""
    for axis in range(3):
        low = centre_low = _INF
        high = centre_high = -_INF
        for i in range(first, end):
            centre = _centre(boxes, i, axis)
            low = min(low, boxes[i, axis])
            high = max(high, boxes[i, axis + 3])
            centre_low = min(centre_low, centre)
            centre_high = max(centre_high, centre)
        bounds[axis] = low
        bounds[axis + 3] = high
        centres[axis] = centre_low
        centres[axis + 3] = centre_high


# ---------------------------------------------------------------------------- the binning


@kernel
def _bins_per_length(centres, axis):
    """Return the scale from a distance along an axis to bins; 0 without extent."""
    extent = np.float64(centres[axis + 3]) - np.float64(centres[axis])
    return BINS / extent if extent > 0.0 else 0.0


@kernel
def _bin(centre, start, scale):
    """Return the bin of a centre. In float64, which the largest floats cannot overflow."""
    return min(int((np.float64(centre) - np.float64(start)) * scale), BINS - 1)


@kernel
def _fill_bins(boxes, first, end, centres, bin_bounds, bin_counts):
    """Count and enclose the boxes of each bin along each axis."""
    bin_bounds[:, :, :3] = _INF
    bin_bounds[:, :, 3:] = -_INF
    bin_counts[:] = 0
    for axis in range(3):
        scale = _bins_per_length(centres, axis)
        for i in range(first, end):
            k = _bin(_centre(boxes, i, axis), centres[axis], scale)
            bin_counts[axis, k] += 1
            _grow(bin_bounds[axis, k], boxes[i])


@kernel
def _grow(bounds, box):
    """Enlarge `bounds` to hold a box."""
    for j in range(3):
        bounds[j] = min(bounds[j], box[j])
        bounds[j + 3] = max(bounds[j + 3], box[j + 3])


@kernel
def _half_area(box):
    """Return half the surface of a box, in float64, which no box of floats overflows."""
    a = np.float64(box[3]) - np.float64(box[0])
    b = np.float64(box[4]) - np.float64(box[1])
    c = np.float64(box[5]) - np.float64(box[2])
    return a * b + b * c + c * a


@kernel
def _cheapest_split(bounds, bin_bounds, bin_counts, right_cost):
    """Return (cost, axis, border): bins below the border go left.

    Of equal costs the more balanced split is taken, or else points on a line, whose boxes
    have no area, would be split off bin by bin. The cost is infinite where all centres
    fall into one bin.
    """
    area = _half_area(bounds)
    per_area = BLOCK_COST / area if area > 0.0 else 0.0
    side = local_f32(6)
    best_cost = np.inf
    best_axis = best_border = best_balance = 0
    for axis in range(3):
        side[:3] = _INF
        side[3:] = -_INF
        right = 0
        for k in range(BINS - 1, 0, -1):
            if bin_counts[axis, k] > 0:
                right += bin_counts[axis, k]
                _grow(side, bin_bounds[axis, k])
            right_cost[k] = _half_area(side) * _blocks(right) if right > 0 else 0.0
        size = right + bin_counts[axis, 0]

        side[:3] = _INF
        side[3:] = -_INF
        left = 0
        for border in range(1, BINS):
            if bin_counts[axis, border - 1] == 0:
                continue  # same split as at the last border
            left += bin_counts[axis, border - 1]
            if left == size:
                break
            _grow(side, bin_bounds[axis, border - 1])
            both = _half_area(side) * _blocks(left) + right_cost[border]
            cost = TRAVERSAL_COST + per_area * both
            balance = min(left, size - left)
            if cost < best_cost or (cost == best_cost and balance > best_balance):
                best_cost, best_balance = cost, balance
                best_axis, best_border = axis, border
    return best_cost, best_axis, best_border


# ------------------------------------------------------------------------- the two halves


@kernel
def _exchange(boxes, order, i, j):
    """Let two primitives change places."""
    for k in range(6):
        boxes[i, k], boxes[j, k] = boxes[j, k], boxes[i, k]
    order[i], order[j] = order[j], order[i]


@kernel
def _partition(boxes, order, first, end, centres, axis, border):
    """Move the boxes in bins below the border to the front; return where the rest begins.

    Nothing moves, and `first` is returned, for border 0 (no split found).
    """
    start = centres[axis]
    scale = _bins_per_length(centres, axis)
    i = first
    j = end - 1
    while True:
        while i <= j and _bin(_centre(boxes, i, axis), start, scale) < border:
            i += 1
        while i <= j and _bin(_centre(boxes, j, axis), start, scale) >= border:
            j -= 1
        if i >= j:
            return i
        _exchange(boxes, order, i, j)


@kernel
def _split_at_median(boxes, order, first, end, middle, centres):
    """Move the smaller half of the centres on the longest axis below `middle`.

    Hoare's quickselect; it stops at equal centres, so that coincident boxes are halved.
    """
    axis = 0
    for other in range(1, 3):
        longest = np.float64(centres[axis + 3]) - np.float64(centres[axis])
        if np.float64(centres[other + 3]) - np.float64(centres[other]) > longest:
            axis = other
    low = first
    high = end - 1
    while low < high:
        pivot = _centre(boxes, (low + high) // 2, axis)
        i = low
        j = high
        while i <= j:
            while _centre(boxes, i, axis) < pivot:
                i += 1
            while _centre(boxes, j, axis) > pivot:
                j -= 1
            if i <= j:
                _exchange(boxes, order, i, j)
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return
