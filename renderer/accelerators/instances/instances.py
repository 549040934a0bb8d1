"""Groups and instances: a tree over the instances, and below it one tree for each group.

The lecture's objects that hold objects: a ray that meets the box of an instance goes on
in the object's own space, where the group's tree waits, stored once however many
instances there are. The direction is not normalised there, so t means the same in both
spaces. Of equal t the smallest primitive id wins, then the smallest instance id.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.wide.wide_rays import any_hits, nearest_hits
from renderer.accelerators.instances.instance_streams import trace_placed
from renderer.kernels.jit import method_kernel
from renderer.kernels.lanes.functions import splat_i32
from renderer.kernels.lanes.memory import store_row
from renderer.kernels.records.kernel_scene import Placements


class Instances(NamedTuple):
    """Nodes of eight: those of the tree over the instances, then those of the groups."""

    floats: NDArray[np.float32]  # (nodes * 32,) see `wide_bvh_build`
    integers: NDArray[np.int32]  # the same memory; ~k is instance k, then come the leaves
    octets: NDArray[np.uint8]  # the same memory
    order: NDArray[np.int32]  # (nodes * 8,) of the children, see `far_to_near`
    root: NDArray[np.int32]  # (instances,) the node or ~leaf that an instance's group is
    leaves: NDArray[np.int32]  # (4 * leaves,) see `placed_leaves`
    # Boxes are padded for rays that start with |x| + |y| + |z| <= reach. Others meet all
    # instances.
    reach: float
    placements: Placements
    triangles: Any  # of all groups, in blocks of eight; None: no group has this kind
    rectangles: Any
    disks: Any
    spheres: Any
    cylinders: Any
    implicits: Any  # not in blocks, nor are the next
    sdf_cells: Any


@method_kernel
def closest_hit_instances(instances, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1; the last of all kinds to do so."""
    for i in range(first, first + count, 16):
        store_row(hits.instance, 0, i, splat_i32(-1))
    query = nearest_hits(rays, hits)
    trace_placed(instances, query, hits.instance, first, count, tally)


@method_kernel
def any_hit_instances(instances, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays."""
    query = any_hits(shadow_rays)
    trace_placed(instances, query, query.prim, np.int64(0), count, tally)
