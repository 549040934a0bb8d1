"""Wide bounding volume hierarchy: eight children per node, eight primitives per leaf.

There are three traversals, which find the same hits:

- bundles of 16 rays, for camera rays and, if all lights are without extent, for the shadow
  rays of camera hits. They use the binary tree that the wide one was made from; both trees
  share the leaves (`ray_packets`). The wide tree gives their start nodes (`beams`);
- streams, for rays after a bounce: all rays of a batch that enter a node are tested there
  together (`ray_streams`);
- single rays, for batches of few rays and for short lists of a stream (`wide_rays`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.streams.ray_packets import PairedBvh, trace_bundles
from renderer.accelerators.bvh.streams.ray_streams import trace_stream
from renderer.accelerators.bvh.wide.wide_bvh_build import collapse, far_to_near, pack_pairs
from renderer.accelerators.rays.query import traverse, traverse_coherent
from renderer.plugins.shapes.blocks import WIDTH, blocks_of
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

# Fewer rays are traced one by one. As a stream they would take up to 1.6 times as long (8
# rays). Streams are faster by 1.06 (6320 triangles) and 1.11 (24,002) at 64 rays, and by
# 1.27 and 1.58 at 128.
FEW = 64
# In a tree of more primitives, single rays stay ahead for longer, since eight of them
# overlap their memory latency. Speed-up of streams for 327,680 triangles: 64 rays 0.83, 128
# rays 0.95, 256 rays 1.08.
LARGE = 100_000
FEW_IN_LARGE = 256


class WideBvh(NamedTuple):
    """The nodes and leaves of the wide tree, and a binary tree over the same leaves."""

    floats: NDArray[np.float32]  # (nodes * 32,) see `wide_bvh_build`
    integers: NDArray[np.int32]  # the same memory
    octets: NDArray[np.uint8]  # the same memory
    order: NDArray[np.int32]  # (nodes * 8,) order of the children, see `far_to_near`
    blocks: Any  # primitives, eight per leaf
    few: int  # fewer rays are traced one by one
    boxes: NDArray[np.float32]  # (blocks, 6 * 8) lower, then upper corners of primitives
    pair_of: NDArray[np.int32]  # (nodes * 8,) node in `pairs` of each child
    pairs: PairedBvh


def build_wide(extents: Extents, group: PrimitiveGroup) -> WideBvh:
    """Build a binary tree by the surface area heuristic, and from it the wide tree."""
    tree = build_tree(extents.lower, extents.upper)
    leaves = np.flatnonzero(tree.count)
    leaves = leaves[np.argsort(tree.child[leaves])]
    first, count = tree.child[leaves], tree.count[leaves]
    block_starts = WIDTH * np.arange(len(leaves), dtype=np.int32)
    columns = np.full(WIDTH * len(leaves), -1, np.int64)
    columns[np.arange(len(tree.order)) + np.repeat(block_starts - first, count)] = (
        tree.order
    )
    child = tree.child.copy()
    child[leaves] = block_starts
    blocks = blocks_of(group, columns)
    octets, pair_of = collapse(tree.bounds, child, tree.count)
    floats, integers = octets.view(np.float32), octets.view(np.int32)
    pairs = pack_pairs(tree.bounds, child, tree.count)
    return WideBvh(
        floats,
        integers,
        octets,
        far_to_near(floats, integers, octets),
        blocks,
        FEW if len(tree.order) <= LARGE else FEW_IN_LARGE,
        _boxes_in_blocks(extents, columns),
        pair_of,
        PairedBvh(pairs.view(np.float32), pairs.view(np.int32), blocks),
    )


def _boxes_in_blocks(extents: Extents, columns: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the boxes of each block's primitives; unused slots have inverted boxes."""
    found = np.full((len(columns) // WIDTH, 6, WIDTH), np.inf, np.float32)
    found[:, 3:] = -np.inf
    filled = np.flatnonzero(columns >= 0)
    block, k = np.divmod(filled, WIDTH)
    found[block, :3, k] = extents.lower[:, columns[filled]].T
    found[block, 3:, k] = extents.upper[:, columns[filled]].T
    return found.reshape(len(found), 6 * WIDTH)


traverse_coherent.by(WideBvh)(trace_bundles)
traverse.by(WideBvh)(trace_stream)
