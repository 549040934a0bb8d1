"""Wide bounding volume hierarchy: eight children a node, eight primitives a leaf.

Rays go through it in three ways, which all find the same hits:

- camera rays, and shadow rays from what they meet in scenes whose lights have no extent, in
  bundles of 16 through the binary tree that the wide one is made from; both share the
  leaves (`ray_packets`), and the wide one tells where bundles begin (`beams`);
- what comes after a bounce in streams: all rays of a batch that enter a node are tested
  there (`ray_streams`);
- batches of few rays, and the few rays of a stream that still go the same way, one by one
  (`wide_rays`).
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

# Fewer rays than this are no stream, or it takes up to 1.6 times as long as rays one by one
# (8 rays). At 64 the stream is ahead by 1.06 (6320 triangles) and 1.11 (24,002), at 128 by
# 1.27 and 1.58.
FEW = 64
# In a tree of more primitives than this, rays one by one are ahead for longer, since eight
# of them wait for memory at the same time: 327,680 triangles, 64 rays 0.83, 128 rays 0.95,
# 256 rays 1.08.
LARGE = 100_000
FEW_IN_LARGE = 256


class WideBvh(NamedTuple):
    """Nodes, leaves, and the same leaves under a binary tree for bundles of rays."""

    floats: NDArray[np.float32]  # (nodes * 32,) see `wide_bvh_build`
    integers: NDArray[np.int32]  # the same memory
    octets: NDArray[np.uint8]  # the same memory
    order: NDArray[np.int32]  # (nodes * 8,) of the children, see `far_to_near`
    blocks: Any  # primitives, eight a leaf
    few: int  # fewer rays go one by one
    boxes: NDArray[np.float32]  # (blocks, 6 * 8) lower, then upper corners of primitives
    pair_of: NDArray[np.int32]  # (nodes * 8,) of each child, its node in `pairs`
    pairs: PairedBvh


def build_wide(extents: Extents, group: PrimitiveGroup) -> WideBvh:
    """Build a binary tree by the surface area heuristic, and from it the wide one."""
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
    """Return the boxes of the primitives of each block; an empty place is met by no ray."""
    found = np.full((len(columns) // WIDTH, 6, WIDTH), np.inf, np.float32)
    found[:, 3:] = -np.inf
    filled = np.flatnonzero(columns >= 0)
    block, k = np.divmod(filled, WIDTH)
    found[block, :3, k] = extents.lower[:, columns[filled]].T
    found[block, 3:, k] = extents.upper[:, columns[filled]].T
    return found.reshape(len(found), 6 * WIDTH)


traverse_coherent.by(WideBvh)(trace_bundles)
traverse.by(WideBvh)(trace_stream)
