"""kd-tree: a tree of cells with axis-aligned planes [Bentley1975].

The lecture has three rules for the position of a plane:

- the middle: both halves are hit equally often, whatever they hold;
- the median: both halves hold equally many primitives, however often they are hit;
- the least expected cost, by the surface area heuristic [MacDonald1990]. A ray that hits a
  cell hits a part of it with a probability of the ratio of their surface areas, so a cut
  into L and R costs

      C = C_step + A_L / A  n_L C_test + A_R / A  n_R C_test

  against n C_test for a leaf. This cuts off large empty parts and isolates complex ones.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import builder_kernel, kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.cell_tree_build import LEAF, build_cell_tree, choose_plane, set_plane

MIDDLE, MEDIAN, CHEAPEST = 0, 1, 2

STEP_COST = 1.0  # of a step down the tree
TEST_COST = 2.0  # of a primitive test
# Factor for a cut that makes an empty part. The estimate treats the other part as a leaf,
# and so undervalues such a cut [Wald2006].
EMPTY_BONUS = 0.8
# Candidates are the borders of this many equal bins along each axis. The boxes that begin
# and end in each bin are counted, instead of sorted [Hunt2006].
BINS = 64


class KdRule(NamedTuple):
    """The rule by which a kd-tree cuts its cells."""

    number: int  # MIDDLE, MEDIAN or CHEAPEST
    begins: NDArray[np.int64]  # (BINS,) number of boxes that begin in each bin
    ends: NDArray[np.int64]  # (BINS,) number of boxes that end in each bin


def build_kd_tree(extents: Extents, group: PrimitiveGroup, rule: int) -> CellTree:
    """Build with one of the three rules: MIDDLE, MEDIAN or CHEAPEST."""
    bins = np.zeros((2, BINS), np.int64)
    tree: Any = build_cell_tree(extents, group, KdRule(rule, bins[0], bins[1]), None)
    return tree


@choose_plane.by(KdRule)
@builder_kernel
def _choose_plane(rule, places, columns, cell, depth, plane):
    """Write the plane that the rule chooses; return False for a leaf."""
    if len(columns) <= LEAF:
        return False
    if rule.number == CHEAPEST:
        return cheapest_plane(rule, places, columns, cell, plane)
    # the longest axis on which some box is on one side of the plane only
    longest = np.float32(0.0)
    for axis in range(3):
        length = cell[axis + 3] - cell[axis]
        if length <= longest:
            continue
        if rule.number == MIDDLE:
            position = np.float32(0.5) * cell[axis] + np.float32(0.5) * cell[axis + 3]
        else:
            position = median_plane(places.boxes, columns, axis)
        inside = cell[axis] < position < cell[axis + 3]
        if inside and _parts(places.boxes, columns, axis, position):
            longest = length
            set_plane(plane, axis, position)
    return longest > 0.0


@builder_kernel
def median_plane(boxes, columns, axis):
    """Return the median of the centres of some boxes."""
    centres = np.empty(len(columns), np.float32)
    for i in range(len(columns)):
        box = boxes[columns[i]]
        centres[i] = np.float32(0.5) * box[axis] + np.float32(0.5) * box[axis + 3]
    return np.sort(centres)[len(centres) // 2]


@kernel
def _parts(boxes, columns, axis, position):
    """Return whether some box is on one side of a plane only."""
    for k in columns:
        if boxes[k, axis] > position or boxes[k, axis + 3] < position:
            return True
    return False


# ------------------------------------------------------------- surface area heuristic


@kernel
def cheapest_plane(rule, places, columns, cell, plane):
    """Write the plane with the least C; return False if none is cheaper than a leaf."""
    least = TEST_COST * len(columns)
    found = False
    for axis in range(3):
        low = np.float64(cell[axis])
        width = (np.float64(cell[axis + 3]) - low) / BINS
        if not width > 0.0:
            continue
        rule.begins[:] = 0
        rule.ends[:] = 0
        for k in columns:
            rule.begins[_bin(places.boxes[k, axis], low, width)] += 1
            rule.ends[_bin(places.boxes[k, axis + 3], low, width)] += 1
        below, above = 0, len(columns)
        for border in range(1, BINS):
            below += rule.begins[border - 1]
            above -= rule.ends[border - 1]
            position = np.float32(low + border * width)
            cost = split_cost(cell, axis, position, below, above)
            if cost < least and cell[axis] < position < cell[axis + 3]:
                least, found = cost, True
                set_plane(plane, axis, position)
    return found


@kernel
def _bin(position, low, width):
    """Return the bin of a coordinate, clamped to the cell's bins."""
    return min(max(int((np.float64(position) - low) / width), 0), BINS - 1)


@kernel
def split_cost(cell, axis, position, below, above):
    """Return C of a cut with `below` and `above` primitives on the sides of the plane."""
    height = np.float64(cell[axis + 3]) - np.float64(cell[axis])
    b = np.float64(cell[(axis + 1) % 3 + 3]) - np.float64(cell[(axis + 1) % 3])
    c = np.float64(cell[(axis + 2) % 3 + 3]) - np.float64(cell[(axis + 2) % 3])
    low = np.float64(position) - np.float64(cell[axis])
    area = b * c + height * (b + c)  # half the surface area
    if not area > 0.0:
        return np.inf
    met_below = (b * c + low * (b + c)) / area
    met_above = (b * c + (height - low) * (b + c)) / area
    cost = STEP_COST + TEST_COST * (met_below * below + met_above * above)
    return EMPTY_BONUS * cost if below == 0 or above == 0 else cost
