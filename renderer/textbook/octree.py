"""Octree: a cube cut into eight equal cubes, recursively where it is crowded.

The lecture's criterion: a cell is cut while it holds more than `LEAF` primitives and the
depth allows. Traversal of nodes with eight children is complex; the slides propose the
algorithm of the kd-tree instead. So a cut into eight is three binary cuts here, across x,
then y, then z, and every third level of the tree is a level of the octree.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.cell_tree_build import (
    LEAF,
    bounds_of,
    build_cell_tree,
    choose_plane,
    set_plane,
)

MAX_LEVELS = 16  # of nested cubes
# A cut that doubles the references or more does not help. Around a vertex where more than
# LEAF triangles meet, such cuts would go on to the last level. A large cell may still be
# cut: a wall in its middle is copied into four cells once, and then no more.
MOST_COPIES = 2
WALL_COPIES = 5
LARGE = 64


class Octants(NamedTuple):
    """The rule: cut all cells in the middle, across the three axes in turn."""

    levels: int


def build_octree(extents: Extents, group: PrimitiveGroup) -> CellTree:
    """Build from a cube around all primitives."""
    low, high = bounds_of(extents).reshape(2, 3)
    centre, half = 0.5 * low + 0.5 * high, (0.5 * high - 0.5 * low).max()
    cube = np.concatenate((centre - half, centre + half)).astype(np.float32)
    tree: Any = build_cell_tree(extents, group, Octants(MAX_LEVELS), cube)
    return tree


@choose_plane.by(Octants)
@kernel
def _choose_plane(rule, places, columns, cell, depth, plane):
    """Write the next plane through the middle; return False for a leaf."""
    axis = depth % 3
    if axis == 0 and not (depth < 3 * rule.levels and _helps(places, columns, cell)):
        return False
    middle = np.float32(0.5) * cell[axis] + np.float32(0.5) * cell[axis + 3]
    set_plane(plane, axis, middle)
    return len(columns) > 0 and cell[axis] < middle < cell[axis + 3]


@kernel
def _helps(places, columns, cell):
    """Return whether a cell is crowded and a cut would divide its primitives."""
    size = len(columns)
    if size <= LEAF:
        return False
    references = 0
    for k in columns:
        copies = 1
        for axis in range(3):
            middle = np.float32(0.5) * cell[axis] + np.float32(0.5) * cell[axis + 3]
            if places.boxes[k, axis] <= middle <= places.boxes[k, axis + 3]:
                copies *= 2
        references += copies
    if size > LARGE:
        return references <= WALL_COPIES * size
    return references < MOST_COPIES * size
