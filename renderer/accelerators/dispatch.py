"""Which kernels trace rays through which structure; they are called by their addresses."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.accelerators.bvh.bvh import (
    Bvh,
    any_hit_bvh,
    any_hit_bvh_packets,
    closest_hit_bvh,
    closest_hit_bvh_packets,
)
from renderer.accelerators.bvh.wide_bvh import (
    WideBvh,
    any_hit_wide,
    any_hit_wide_bundles,
    closest_hit_wide,
    closest_hit_wide_bundles,
)
from renderer.accelerators.instances.instances import (
    Instances,
    any_hit_instances,
    closest_hit_instances,
)
from renderer.accelerators.rays.boxes import (
    Boxes,
    any_hit_boxes,
    closest_hit_boxes,
)
from renderer.accelerators.rays.brute_force import (
    BruteForce,
    any_hit_brute_force,
    closest_hit_brute_force,
)
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.grid_walk import Grids
from renderer.textbook.one_ray import any_hit_ray_by_ray, closest_hit_ray_by_ray


class Traversals(NamedTuple):
    """The kernels of one structure; many have no other way for coherent rays."""

    closest_hit_coherent: Any
    closest_hit: Any
    any_hit_coherent: Any
    any_hit: Any


def _alike(closest_hit: Any, any_hit: Any) -> Traversals:
    return Traversals(closest_hit, closest_hit, any_hit, any_hit)


TRAVERSALS = {
    BruteForce: _alike(closest_hit_brute_force, any_hit_brute_force),
    Boxes: _alike(closest_hit_boxes, any_hit_boxes),
    Bvh: Traversals(
        closest_hit_bvh_packets, closest_hit_bvh, any_hit_bvh_packets, any_hit_bvh
    ),
    WideBvh: Traversals(
        closest_hit_wide_bundles, closest_hit_wide, any_hit_wide_bundles, any_hit_wide
    ),
    Instances: _alike(closest_hit_instances, any_hit_instances),
    BoxTree: _alike(closest_hit_ray_by_ray, any_hit_ray_by_ray),
    CellTree: _alike(closest_hit_ray_by_ray, any_hit_ray_by_ray),
    Grids: _alike(closest_hit_ray_by_ray, any_hit_ray_by_ray),
}
