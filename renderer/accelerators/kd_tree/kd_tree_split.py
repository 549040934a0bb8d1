"""Where to split a cell of a kd-tree: in the middle, at the median, where it is cheapest.

The lecture's estimate for a cell split into L and R, by the surface area heuristic
[MacDonald1990]: a ray that meets a cell meets a part of it with a probability of the ratio
of their surface areas, so

    C = C_trav + A_L/A C_leaf(n_L) + A_R/A C_leaf(n_R)

Only the sides of boxes are candidates, because between them C is linear in the position.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.rays.sorting import median_of, sort_few
from renderer.accelerators.surface_area import half_area
from renderer.kernels.jit import kernel

MIDDLE, MEDIAN, CHEAPEST = 0, 1, 2  # rules
NONE = -1  # instead of an axis: no split found

BLOCK = 8  # primitives that a leaf tests at once
TRAVERSAL_COST = 1.0  # of one step down the tree
BLOCK_COST = 2.0  # of testing one block of primitives, on the same scale
# What cuts off an empty part is worth more than the estimate says, since the estimate takes
# the other part for a leaf [Wald2006].
EMPTY_BONUS = 0.8
# Above this many references, candidates are the borders of equal bins, and counting them
# replaces sorting: O(n) a level instead of O(n log n). On a bumpy sphere the tree costs 1 %
# more than with sorting everywhere.
EXACT_UP_TO = 256
BINS = 64


@kernel
def leaf_cost(count):
    """Return the cost of a leaf of `count` primitives."""
    return BLOCK_COST * ((count + BLOCK - 1) // BLOCK)


@kernel
def share_below(cell, axis, plane):
    """Return the share of a cell's surface area that its part below a plane has."""
    other, third = (axis + 1) % 3, (axis + 2) % 3
    b = np.float64(cell[other + 3]) - np.float64(cell[other])
    c = np.float64(cell[third + 3]) - np.float64(cell[third])
    area = half_area(cell)
    height = np.float64(plane) - np.float64(cell[axis])
    return (b * c + height * (b + c)) / area if area > 0.0 else 1.0


@kernel
def share_above(cell, axis, plane):
    """Return the share of a cell's surface area that its part above a plane has."""
    other, third = (axis + 1) % 3, (axis + 2) % 3
    b = np.float64(cell[other + 3]) - np.float64(cell[other])
    c = np.float64(cell[third + 3]) - np.float64(cell[third])
    area = half_area(cell)
    height = np.float64(cell[axis + 3]) - np.float64(plane)
    return (b * c + height * (b + c)) / area if area > 0.0 else 1.0


@kernel
def split_cost(cell, axis, plane, below, above):
    """Return C of a split with so many references below and above the plane."""
    cost = share_below(cell, axis, plane) * leaf_cost(below)
    cost += share_above(cell, axis, plane) * leaf_cost(above)
    cost += TRAVERSAL_COST
    return EMPTY_BONUS * cost if below == 0 or above == 0 else cost


@kernel
def longest_axis(cell, rank):
    """Return the axis along which a cell is longest (rank 0), second, or third (rank 2)."""
    for axis in range(3):
        longer = 0
        length = np.float64(cell[axis + 3]) - np.float64(cell[axis])
        for other in range(3):
            its = np.float64(cell[other + 3]) - np.float64(cell[other])
            if its > length or (its == length and other < axis):
                longer += 1
        if longer == rank:
            return axis
    return 0


@kernel
def middle_plane(cell, axis):
    """Return the plane that halves a cell."""
    return np.float32(0.5) * cell[axis] + np.float32(0.5) * cell[axis + 3]


@kernel
def median_plane(boxes, begin, end, axis, scratch):
    """Return the plane through the median of the boxes' centres."""
    count = end - begin
    for r in range(count):
        box = boxes[begin + r]
        scratch[r] = np.float32(0.5) * box[axis] + np.float32(0.5) * box[axis + 3]
    return median_of(scratch, count)


@kernel
def cheapest_split(boxes, begin, end, cell, starts, ends, counts):
    """Return (cost, axis, plane) of the split with the least C; the first of equals.

    `starts` and `ends` have room for one number a box, `counts` for (2, BINS).
    """
    best = (np.inf, NONE, np.float32(0.0))
    for axis in range(3):
        if end - begin > EXACT_UP_TO:
            found = _sweep_bins(boxes, begin, end, cell, axis, counts)
        else:
            found = _sweep_sides(boxes, begin, end, cell, axis, starts, ends)
        if found[0] < best[0]:
            best = (found[0], axis, found[1])
    return best


@kernel
def _sweep_sides(boxes, begin, end, cell, axis, starts, ends):
    """Return (cost, plane) of the best split at the side of a box.

    The sweep over events of [Wald2006], by sorting in each cell: O(n log^2 n) in all.
    Boxes are grown, so that none is flat, and what starts at a plane lies above it only.
    """
    count = end - begin
    for r in range(count):
        starts[r] = boxes[begin + r, axis]
        ends[r] = boxes[begin + r, axis + 3]
    sort_few(starts, count)
    sort_few(ends, count)
    cost, best = np.inf, np.float32(0.0)
    started = ended = 0
    while ended < count:
        plane = ends[ended]
        if started < count and starts[started] < plane:
            plane = starts[started]
        # below: all that start before the plane; above: all that end behind it
        below = started
        while ended < count and ends[ended] == plane:
            ended += 1
        if cell[axis] < plane < cell[axis + 3]:
            its = split_cost(cell, axis, plane, below, count - ended)
            if its < cost:
                cost, best = its, plane
        while started < count and starts[started] == plane:
            started += 1
    return cost, best


@kernel
def _sweep_bins(boxes, begin, end, cell, axis, counts):
    """Return (cost, plane) of the best split at the border of a bin [Hunt2006].

    Counting in which bins boxes start and end takes the place of sorting.
    """
    low = np.float64(cell[axis])
    width = (np.float64(cell[axis + 3]) - low) / BINS
    if not width > 0.0:
        return np.inf, np.float32(0.0)
    counts[:] = 0
    for r in range(begin, end):
        first = (np.float64(boxes[r, axis]) - low) / width
        last = (np.float64(boxes[r, axis + 3]) - low) / width
        counts[0, min(max(int(first), 0), BINS - 1)] += 1
        counts[1, min(max(int(last), 0), BINS - 1)] += 1
    cost, best = np.inf, np.float32(0.0)
    below, above = 0, end - begin
    for border in range(1, BINS):
        below += counts[0, border - 1]
        above -= counts[1, border - 1]
        plane = np.float32(low + border * width)
        if cell[axis] < plane < cell[axis + 3]:
            its = split_cost(cell, axis, plane, below, above)
            if its < cost:
                cost, best = its, plane
    return cost, best
