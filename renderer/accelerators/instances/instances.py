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

from renderer.accelerators.instances.instance_streams import trace_instances
from renderer.accelerators.rays.query import traverse
from renderer.kernels.records.kernel_scene import Placements


class Instances(NamedTuple):
    """Nodes of eight: those of the tree over the instances, then those of the groups."""

    floats: NDArray[np.float32]  # (nodes * 32,) see `wide_bvh_build`
    integers: NDArray[np.int32]  # the same memory; ~k is instance k, then come the leaves
    octets: NDArray[np.uint8]  # the same memory
    order: NDArray[np.int32]  # (nodes * 8,) of the children, see `far_to_near`
    root: NDArray[np.int32]  # (instances,) the node or ~leaf that an instance's group is
    leaves: NDArray[np.int32]  # (4 * leaves,) see `instance_streams`
    # Boxes are padded for rays that start with |x| + |y| + |z| <= reach. Others meet all
    # instances.
    reach: float
    placements: Placements
    primitives: Any  # `instance_streams.Primitives` of all groups


traverse.by(Instances)(trace_instances)
