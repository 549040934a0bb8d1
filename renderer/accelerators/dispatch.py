"""The traversal kernels of each structure; stages call them by address.

A structure implements `traverse` (`rays.query`), and `traverse_coherent` if it has a faster
method for coherent rays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.wide_bvh import WideBvh
from renderer.accelerators.instances.instances import Instances
from renderer.accelerators.rays.boxes import Boxes, BruteForce
from renderer.accelerators.rays.query import (
    any_hits,
    nearest_hits,
    traverse,
    traverse_coherent,
)
from renderer.kernels.jit import method_kernel
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.grid_walk import Grids
from renderer.textbook.one_ray import trace_ray_by_ray


class Traversals(NamedTuple):
    """The kernels of one structure; without `traverse_coherent` both kinds are the same."""

    closest_hit_coherent: Any
    closest_hit: Any
    any_hit_coherent: Any
    any_hit: Any


@method_kernel
def closest_hit(accel, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1 with nearer hits."""
    traverse(accel, nearest_hits(rays, hits), first, count, tally)


@method_kernel
def closest_hit_coherent(accel, rays, hits, first, count, tally):
    """Update `hits` of coherent rays first to first + count - 1 with nearer hits."""
    traverse_coherent(accel, nearest_hits(rays, hits), first, count, tally)


@method_kernel
def any_hit(accel, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays that meet a primitive before t_max."""
    traverse(accel, any_hits(shadow_rays), np.int64(0), count, tally)


@method_kernel
def any_hit_coherent(accel, shadow_rays, count, tally):
    """Set `blocked` of the first `count` coherent shadow rays."""
    traverse_coherent(accel, any_hits(shadow_rays), np.int64(0), count, tally)


_RAY_BY_RAY = (BoxTree, CellTree, Grids)
traverse.by(*_RAY_BY_RAY)(trace_ray_by_ray)

TRAVERSALS = {
    structure: Traversals(closest_hit_coherent, closest_hit, any_hit_coherent, any_hit)
    if traverse_coherent.has(structure)
    else Traversals(closest_hit, closest_hit, any_hit, any_hit)
    for structure in (BruteForce, Boxes, Bvh, WideBvh, Instances, *_RAY_BY_RAY)
}
