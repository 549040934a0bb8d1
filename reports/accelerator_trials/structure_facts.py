"""What some structures can say of themselves: their depth, and the cost they expect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost, bvh_depth
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree, cells_of, tree_cost


class StructureFacts(NamedTuple):
    """None where a structure has no such thing."""

    depth: int | None  # edges from the root to the deepest leaf
    cost: float | None  # of a ray that meets the root, by the surface area heuristic


def _bvh_tree(tree: BoxTree) -> BvhTree:
    count = np.where(tree.child == 0, tree.end - tree.first, 0)
    return BvhTree(tree.boxes, tree.child, count, tree.items)


# record -> how its depth and its cost are found
_DEPTH: dict[type, Callable[[Any], int]] = {
    Bvh: bvh_depth,
    BoxTree: lambda tree: bvh_depth(_bvh_tree(tree)),
    CellTree: lambda tree: int(cells_of(tree)[1].max()),
}
_COST: dict[type, Callable[[Any], float | None]] = {
    Bvh: bvh_cost,
    BoxTree: lambda tree: bvh_cost(_bvh_tree(tree)),
    CellTree: tree_cost,
}


def structure_facts(accel: Any) -> StructureFacts:
    """Return what is known of a structure beyond its arrays."""
    depth, cost = _DEPTH.get(type(accel)), _COST.get(type(accel))
    return StructureFacts(
        None if depth is None else depth(accel), None if cost is None else cost(accel)
    )
