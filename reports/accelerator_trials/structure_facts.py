"""What some structures can say of themselves: their depth, and the cost they expect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.bvh_tree import bvh_cost, bvh_depth
from renderer.accelerators.kd_tree.kd_tree import KdTree
from renderer.accelerators.kd_tree.kd_tree_checks import kd_cells, kd_cost
from renderer.accelerators.octree_and_bsp.bsp import Bsp
from renderer.accelerators.octree_and_bsp.octree import Octree
from renderer.accelerators.octree_and_bsp.octree_checks import octree_cells


class StructureFacts(NamedTuple):
    """None where a structure has no such thing."""

    depth: int | None  # edges from the root to the deepest leaf
    cost: float | None  # of a ray that meets the root, by the surface area heuristic


# record -> how its depth and its cost are found
_DEPTH: dict[type, Callable[[Any], int]] = {
    Bvh: bvh_depth,
    Bsp: bvh_depth,  # its nodes name children and leaves as a Bvh's do
    KdTree: lambda tree: int(kd_cells(tree)[1].max()),
    Octree: lambda tree: int(octree_cells(tree)[1].max()),
}
_COST: dict[type, Callable[[Any], float]] = {Bvh: bvh_cost, KdTree: kd_cost}


def structure_facts(accel: Any) -> StructureFacts:
    """Return what is known of a structure beyond its arrays."""
    depth, cost = _DEPTH.get(type(accel)), _COST.get(type(accel))
    return StructureFacts(
        None if depth is None else depth(accel), None if cost is None else cost(accel)
    )
