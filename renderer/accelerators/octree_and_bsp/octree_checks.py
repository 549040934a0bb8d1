"""What can be said of any octree: whether it is sound, and how deep it is.

The slow truth beside the builder: `validate_octree_arrays` says whether a traversal can
miss anything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.octree_and_bsp.cell_checks import (
    in_sorted,
    reaches_into,
    require_lists,
    require_none,
)
from renderer.accelerators.octree_and_bsp.octree_build import MAX_DEPTH
from renderer.plugins.shapes.extents import Extents

_BITS = np.arange(8)[:, None] >> np.arange(3) & 1 == 1  # (8, 3) above the centre?


def octree_cells(tree: Any) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the cell (cells, 6) and the depth (cells,) of each cell of a sound tree.

    Only centres cut: the outermost cells reach to infinity.
    """
    cells = np.empty((len(tree.link), 6), np.float32)
    cells[0] = (*[-np.inf] * 3, *[np.inf] * 3)
    depth = np.zeros(len(tree.link), np.int64)
    level = np.zeros(1, np.int64)
    while level.size:
        level = level[tree.link[level] >= 0]
        block = tree.link[level].astype(np.int64)
        centre = tree.centre[block][:, None]
        cell = cells[level][:, None]
        children = 1 + 8 * block[:, None] + np.arange(8)
        cells[children, :3] = np.where(_BITS, centre, cell[..., :3])
        cells[children, 3:] = np.where(_BITS, cell[..., 3:], centre)
        depth[children] = depth[level][:, None] + 1
        level = children.ravel()
    return cells, depth


def validate_octree_arrays(tree: Any, extents: Extents) -> None:
    """Check that a tree is one and that each cell holds whatever reaches into it.

    Raises
    ------
    ValueError
        If not; the message says which cell or leaf, and what is wrong with it.
    """
    _require_tree(tree)
    require_lists("octree", tree, extents)
    cells, depth = octree_cells(tree)
    numbers = np.arange(len(cells))
    require_none("octree cell", numbers[depth > MAX_DEPTH], "is too deep for the stack")
    crossed = (cells[:, :3] >= cells[:, 3:]).any(axis=1)
    require_none("octree cell", numbers[crossed], "lies outside of the cell it is part of")
    _require_held(tree, extents, cells)


def _require_tree(tree: Any) -> None:
    """Check that every block of cells belongs to exactly one earlier cell."""
    blocks = len(tree.centre)
    if len(tree.link) != 1 + 8 * blocks:
        raise ValueError(f"octree: {blocks} blocks, but {len(tree.link)} cells")
    inner = np.flatnonzero(tree.link >= 0)
    block = tree.link[inner].astype(np.int64)
    require_none("octree cell", inner[block >= blocks], "has children that do not exist")
    require_none("octree cell", inner[1 + 8 * block <= inner], "comes after its children")
    wrong = np.flatnonzero(np.bincount(block, minlength=blocks) != 1)
    require_none("octree block", wrong, "is not part of exactly one cell")
    leaves = np.sort(-1 - tree.link[tree.link < 0])
    if not np.array_equal(leaves[leaves > 0], np.arange(1, len(tree.first) - 1)):
        raise ValueError("octree leaves are not numbered 1, 2, 3, ...")
    if tree.first[1] != 0:
        raise ValueError("octree leaf 0, of the empty cells, is not empty")


def _require_held(tree: Any, extents: Extents, cells: NDArray[np.float32]) -> None:
    """Check that each leaf lists whatever reaches into its cell.

    All primitives go down the tree, each to wherever its box reaches.
    """
    n, half = extents.lower.shape[1], extents.pad / 2
    lower, upper = extents.lower.T - half, extents.upper.T + half
    leaf = np.repeat(np.arange(len(tree.first) - 1), np.diff(tree.first))
    listed = np.sort(leaf * n + tree.items)
    # in place of infinity: far outside of everything
    far = 4 * np.float64(np.abs(np.concatenate((lower, upper))).max())
    cell, k = np.zeros(n, np.int64), np.arange(n)
    while cell.size:
        at_leaf = tree.link[cell] < 0
        key = (-1 - tree.link[cell[at_leaf]].astype(np.int64)) * n + k[at_leaf]
        missing = np.flatnonzero(at_leaf)[~in_sorted(key, listed)]
        box = np.clip(cells[cell[missing]].astype(np.float64), -far, far)
        lost = missing[reaches_into(extents, k[missing], box[:, :3], box[:, 3:])]
        if lost.size:
            raise ValueError(
                f"octree cell {cell[lost[0]]} does not list primitive {k[lost[0]]} "
                f"(of {lost.size} such)"
            )
        cell, k = cell[~at_leaf], k[~at_leaf]
        children = 1 + 8 * tree.link[cell].astype(np.int64)[:, None] + np.arange(8)
        box = cells[children]
        inside = (lower[k, None] < box[..., 3:]) & (upper[k, None] > box[..., :3])
        which, octant = np.nonzero(inside.all(axis=2))
        cell, k = children[which, octant], k[which]
