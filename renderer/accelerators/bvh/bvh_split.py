"""Split one node: the three rules of `bvh_build`, as kernels on an array of boxes.

A row of `boxes` (n, 8) is a primitive's lower corner, 0, its upper corner times -1, 0. So
the union of two boxes is one minimum of 8 lanes. A split permutes the rows of `boxes` and
the entries of `order` together.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.bvh_tree import BLOCK, BLOCK_COST, TRAVERSAL_COST
from renderer.accelerators.surface_area import half_area
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import lane, maximum, minimum, to_double
from renderer.kernels.lanes.memory import (
    load_eight,
    load_four,
    load_one,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import local_f64

BINS = 16
MAX_DEPTH = 60  # edges from the root to the deepest leaf; sizes traversal stacks
SAH, MEDIAN, MIDDLE = range(3)

_INF = np.float32(np.inf)


@kernel
def split(boxes, order, first, end, depth, leaf_size, rule, box, scratch):
    """Partition a node; return where its right part begins.

    Returns `first` if the node is to be a leaf.
    """
    centres = scratch.centres
    size = end - first
    if size <= leaf_size and (rule != SAH or BLOCK_COST * _blocks(size) <= TRAVERSAL_COST):
        return first  # a leaf is cheaper than the split
    middle = first
    if size > 1 and rule != MEDIAN and _levels_for(size) + depth < MAX_DEPTH:
        if rule == SAH:
            _fill_bins(boxes, first, end, scratch)
            cost, axis, border = _cheapest_split(box, scratch)
            worth = size > leaf_size or cost < BLOCK_COST * _blocks(size)
        else:
            axis, border = _longest(centres), BINS // 2
            worth = True
        if worth:
            middle = _partition(boxes, order, first, end, centres, axis, border)
    if (middle == first or middle == end) and size > leaf_size:
        # no border separates the centres, or the tree would become too deep
        middle = first + size // 2
        split_at_median(boxes, order, first, end, middle, centres)
    return first if middle == end else middle


@kernel
def _levels_for(size):
    """Return the levels that median splits need to reach single primitives."""
    levels = 0
    while (1 << levels) < size:
        levels += 1
    return levels


@kernel
def _blocks(size):
    """Return the number of blocks in a leaf of `size` primitives."""
    return (size + BLOCK - 1) // BLOCK


@kernel
def _centre(boxes, i, axis):
    """Return the centre of a box along an axis; halving first cannot overflow."""
    low, high = load_one(boxes, i, axis), -load_one(boxes, i, axis + 4)
    return np.float32(0.5) * low + np.float32(0.5) * high


@kernel
def _centres(boxes, i):
    """Return the centre along each axis, and a zero."""
    half = np.float32(0.5)
    return load_four(boxes, i, 0) * half - load_four(boxes, i, 4) * half


@kernel
def enclose(boxes, first, end, bounds, centres):
    """Write the union of the boxes (lower, upper corner) and the box of their centres."""
    box = load_eight(boxes, first, 0)
    centre_low = centre_high = _centres(boxes, first)
    for i in range(first + 1, end):
        box = minimum(box, load_eight(boxes, i, 0))
        centre = _centres(boxes, i)
        centre_low, centre_high = minimum(centre_low, centre), maximum(centre_high, centre)
    for axis in range(3):
        bounds[axis] = lane(box, axis)
        bounds[axis + 3] = -lane(box, axis + 4)
        centres[axis] = lane(centre_low, axis)
        centres[axis + 3] = lane(centre_high, axis)


# ------------------------------------------------------------------------------- binning


@kernel
def _bins_per_length(centres, axis):
    """Return the bins per length along an axis; 0 if the centres have no extent."""
    extent = np.float64(centres[axis + 3]) - np.float64(centres[axis])
    return BINS / extent if extent > 0.0 else 0.0


@kernel
def _bin(centre, start, scale):
    """Return the bin of a centre. In float64, so that large floats do not overflow."""
    return min(int((np.float64(centre) - np.float64(start)) * scale), BINS - 1)


@kernel
def _fill_bins(boxes, first, end, scratch):
    """Count the boxes of each bin along each axis, and find their unions."""
    centres, bins, counts = scratch.centres, scratch.bins, scratch.counts
    start, scale = local_f64(4), local_f64(4)
    for axis in range(3):
        start[axis], scale[axis] = centres[axis], _bins_per_length(centres, axis)
    starts, scales = load_four(start, 0, 0), load_four(scale, 0, 0)
    # Written so that LLVM makes no masked store of a minimum to where it was loaded: the
    # next load would wait for it, a quarter of the time of this loop.
    nothing = load_eight(scratch.constants, 0, 0)
    for k in range(3 * BINS):
        store_row(bins, k, 0, load_eight(scratch.constants, 1, 0))
        counts[k] = 0
    for i in range(first, end):
        box = load_eight(boxes, i, 0)
        places = (to_double(_centres(boxes, i)) - starts) * scales
        for axis in range(3):
            k = axis * BINS + min(int(lane(places, axis)), BINS - 1)
            store_one(counts, 0, k, load_one(counts, 0, k) + np.int32(1))
            store_row(bins, k, 0, minimum(load_eight(bins, k, 0), box) + nothing)


@kernel
def _half_area(box):
    """Return half the surface area of a box of 8 lanes, as `half_area` does."""
    a = -np.float64(lane(box, 4)) - np.float64(lane(box, 0))
    b = -np.float64(lane(box, 5)) - np.float64(lane(box, 1))
    c = -np.float64(lane(box, 6)) - np.float64(lane(box, 2))
    return a * b + b * c + c * a


@kernel
def _cheapest_split(bounds, scratch):
    """Return (cost, axis, border): bins below the border go left.

    Of equal costs the more balanced split wins. Otherwise points on a line, whose boxes
    have no area, would be split off bin by bin. The cost is infinite if all centres are in
    one bin.
    """
    bins, counts, right_cost = scratch.bins, scratch.counts, scratch.right_cost
    empty = load_eight(scratch.constants, 1, 0)
    area = half_area(bounds)
    per_area = BLOCK_COST / area if area > 0.0 else 0.0
    best_cost = np.inf
    best_axis = best_border = best_balance = 0
    for axis in range(3):
        row = axis * BINS
        side, right, cost = empty, 0, 0.0
        for k in range(BINS - 1, 0, -1):
            if counts[row + k] > 0:
                right += counts[row + k]
                side = minimum(side, load_eight(bins, row + k, 0))
                cost = _half_area(side) * _blocks(right)
            right_cost[k] = cost
        size = right + counts[row]

        side, left = empty, 0
        for border in range(1, BINS):
            k = row + border - 1
            if counts[k] == 0:
                continue  # the bin is empty: same split as at the last border
            left += counts[k]
            if left == size:
                break
            side = minimum(side, load_eight(bins, k, 0))
            both = _half_area(side) * _blocks(left) + right_cost[border]
            cost = TRAVERSAL_COST + per_area * both
            balance = min(left, size - left)
            if cost < best_cost or (cost == best_cost and balance > best_balance):
                best_cost, best_balance = cost, balance
                best_axis, best_border = axis, border
    return best_cost, best_axis, best_border


# ----------------------------------------------------------------------------- partition


@kernel
def _exchange(boxes, order, i, j):
    """Swap two primitives."""
    one, other = load_eight(boxes, i, 0), load_eight(boxes, j, 0)
    store_row(boxes, i, 0, other)
    store_row(boxes, j, 0, one)
    order[i], order[j] = order[j], order[i]


@kernel
def _partition(boxes, order, first, end, centres, axis, border):
    """Move the boxes in bins below the border to the front; return where the rest begins.

    Border 0 means that no split was found: `first` is returned and nothing moves.
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
    """Return the axis along which the box of the centres is longest."""
    axis = 0
    for other in range(1, 3):
        longest = np.float64(centres[axis + 3]) - np.float64(centres[axis])
        if np.float64(centres[other + 3]) - np.float64(centres[other]) > longest:
            axis = other
    return axis


@kernel
def split_at_median(boxes, order, first, end, middle, centres):
    """Move the smaller half of the centres on the longest axis below `middle`.

    Hoare's quickselect. It stops at equal centres, so coincident boxes are halved.
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
