"""Refit a bounding volume hierarchy to moved primitives.

The tree is kept and its boxes are recomputed bottom-up: one pass, where a build sorts.
Hits stay right for any motion [Wald2007a], but the grouping of primitives is that of the
first build. As neighbours part, boxes grow and overlap, until a rebuild costs less than
the slower rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import Bvh
from renderer.kernels.jit import entry_kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup


def refit_bvh(bvh: Bvh, extents: Extents, group: PrimitiveGroup, first: int = 0) -> Bvh:
    """Return the same tree around primitives that have moved.

    Parameters
    ----------
    bvh : Bvh
        A tree over all primitives of one kind.
    extents : Extents
        Their boxes now.
    group : PrimitiveGroup
        Makes the group of the moved primitives in a given order.
    first : int
        Primitive id of column 0.

    Raises
    ------
    ValueError
        If the tree does not hold that number of primitives with ids from `first` on.
    """
    order = leaf_order(bvh, first)
    n = extents.lower.shape[1]
    if len(order) != n or order.min() != 0 or order.max() != n - 1:
        raise ValueError(
            f"the tree holds {len(order)} primitives with ids {first + order.min()} to "
            f"{first + order.max()}, those that moved are {first} to {first + n - 1}"
        )
    bounds = refit_bounds(bvh.child, bvh.count, order, extents)
    return bvh._replace(bounds=bounds, primitives=group(order))


def leaf_order(bvh: Bvh, first: int = 0) -> NDArray[np.int64]:
    """Return the column numbers (n,) of the primitives in leaf order."""
    ids = bvh.primitives.id[: bvh.primitives.count]
    return ids.astype(np.int64) - first


def refit_bounds(
    child: NDArray[np.int32], count: Any, order: NDArray[np.int64], extents: Extents
) -> NDArray[np.float32]:
    """Return the boxes (nodes, 6) of a tree's nodes around moved primitives."""
    bounds = np.empty((len(child), 6), np.float32)
    _refit(child, count, order, extents.lower, extents.upper, bounds)
    return bounds


@entry_kernel
def _refit(child, count, order, lower, upper, bounds):
    """Write all boxes. Children have larger indices than parents, so go backwards."""
    for node in range(len(child) - 1, -1, -1):
        first = child[node]
        if count[node] == 0:
            for axis in range(3):
                bounds[node, axis] = min(bounds[first, axis], bounds[first + 1, axis])
            for axis in range(3, 6):
                bounds[node, axis] = max(bounds[first, axis], bounds[first + 1, axis])
            continue
        for axis in range(3):
            low = lower[axis, order[first]]
            high = upper[axis, order[first]]
            for k in range(first + 1, first + count[node]):
                low = min(low, lower[axis, order[k]])
                high = max(high, upper[axis, order[k]])
            bounds[node, axis] = low
            bounds[node, axis + 3] = high
