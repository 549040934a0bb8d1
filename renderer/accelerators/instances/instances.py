"""Groups and instances: a tree over the instances, and below it one tree per group.

A ray that hits the box of an instance is transformed into object space and traverses the
group's tree, which is stored once for all its instances. The direction is not normalised
there, so t is the same in both spaces. At equal t the smallest primitive id wins, then the
smallest instance id.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.instances.instance_streams import trace_instances
from renderer.accelerators.rays.query import traverse
from renderer.kernels.records.kernel_scene import Placements


class Instances(NamedTuple):
    """Nodes of eight: the tree over the instances, then the trees of the groups."""

    floats: NDArray[np.float32]  # (nodes * 32,) see `wide_bvh_build`
    integers: NDArray[np.int32]  # the same memory; ~k is instance k, larger k are leaves
    octets: NDArray[np.uint8]  # the same memory
    order: NDArray[np.int32]  # (nodes * 8,) order of the children, see `far_to_near`
    root: NDArray[np.int32]  # (instances,) root of the instance's group, a node or ~leaf
    leaves: NDArray[np.int32]  # (4 * leaves,) see `instance_streams`
    # Boxes are padded for rays that start with |x| + |y| + |z| <= reach. Other rays visit
    # all instances.
    reach: float
    placements: Placements
    primitives: Any  # `instance_streams.Primitives` of all groups


traverse.by(Instances)(trace_instances)
