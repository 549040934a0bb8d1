"""Where to split a node: the three rules of `bvh_build`, as kernels on an array of boxes.

`boxes` is (n, 6), lower then upper corner of each primitive; a split permutes its rows and
`order` alike.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.bvh_tree import BLOCK, BLOCK_COST, TRAVERSAL_COST
from renderer.accelerators.surface_area import half_area
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import local_f32

BINS = 16
MAX_DEPTH = 60  # edges from the root to the deepest leaf; sizes traversal stacks
SAH, MEDIAN, MIDDLE = range(3)

_INF = np.float32(np.inf)


@kernel
def split(boxes, order, first, end, depth, leaf_size, rule, box, scratch):
    """Bring the left part to the front; return where the right one begins.

    `first` is returned for what shall be a leaf.
    """
    centres, bin_bounds = scratch.centres, scratch.bin_bounds
    bin_counts, right_cost = scratch.bin_counts, scratch.right_cost
    size = end - first
    if size <= leaf_size and rule != SAH:
        return first
    middle = first
    if size > 1 and rule != MEDIAN and _levels_for(size) + depth < MAX_DEPTH:
        if rule == SAH:
            _fill_bins(boxes, first, end, centres, bin_bounds, bin_counts)
            cost, axis, border = _cheapest_split(box, bin_bounds, bin_counts, right_cost)
            worth = size > leaf_size or cost < BLOCK_COST * _blocks(size)
        else:
            axis, border = _longest(centres), BINS // 2
            worth = True
        if worth:
            middle = _partition(boxes, order, first, end, centres, axis, border)
    if (middle == first or middle == end) and size > leaf_size:
        # no border separates the centres, or the tree grows too deep
        middle = first + size // 2
        split_at_median(boxes, order, first, end, middle, centres)
    return first if middle == end else middle


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
def enclose(boxes, first, end, bounds, centres):
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
    for axis in range(3):
        for k in range(BINS):
            _empty(bin_bounds[axis, k])
            bin_counts[axis, k] = 0
        scale = _bins_per_length(centres, axis)
        for i in range(first, end):
            k = _bin(_centre(boxes, i, axis), centres[axis], scale)
            bin_counts[axis, k] += 1
            _grow(bin_bounds[axis, k], boxes[i])


@kernel
def _empty(bounds):
    """Make a box that holds nothing."""
    for j in range(3):
        bounds[j] = _INF
        bounds[j + 3] = -_INF


@kernel
def _grow(bounds, box):
    """Enlarge `bounds` to hold a box."""
    for j in range(3):
        bounds[j] = min(bounds[j], box[j])
        bounds[j + 3] = max(bounds[j + 3], box[j + 3])


@kernel
def _cheapest_split(bounds, bin_bounds, bin_counts, right_cost):
    """Return (cost, axis, border): bins below the border go left.

    Of equal costs the more balanced split is taken, or else points on a line, whose boxes
    have no area, would be split off bin by bin. The cost is infinite where all centres
    fall into one bin.
    """
    area = half_area(bounds)
    per_area = BLOCK_COST / area if area > 0.0 else 0.0
    side = local_f32(6)
    best_cost = np.inf
    best_axis = best_border = best_balance = 0
    for axis in range(3):
        _empty(side)
        right = 0
        for k in range(BINS - 1, 0, -1):
            if bin_counts[axis, k] > 0:
                right += bin_counts[axis, k]
                _grow(side, bin_bounds[axis, k])
            right_cost[k] = half_area(side) * _blocks(right) if right > 0 else 0.0
        size = right + bin_counts[axis, 0]

        _empty(side)
        left = 0
        for border in range(1, BINS):
            if bin_counts[axis, border - 1] == 0:
                continue  # same split as at the last border
            left += bin_counts[axis, border - 1]
            if left == size:
                break
            _grow(side, bin_bounds[axis, border - 1])
            both = half_area(side) * _blocks(left) + right_cost[border]
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
def _longest(centres):
    """Return the axis along which the centres lie farthest apart."""
    axis = 0
    for other in range(1, 3):
        longest = np.float64(centres[axis + 3]) - np.float64(centres[axis])
        if np.float64(centres[other + 3]) - np.float64(centres[other]) > longest:
            axis = other
    return axis


@kernel
def split_at_median(boxes, order, first, end, middle, centres):
    """Move the smaller half of the centres on the longest axis below `middle`.

    Hoare's quickselect; it stops at equal centres, so that coincident boxes are halved.
    """
    axis = _longest(centres)
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
