"""kd-tree: space halved again and again by planes across the axes.

Cells do not overlap, so a ray visits them front to back and ends at the first cell that
holds a hit, with a stack of the far sides that wait. Where to split is the builder's
choice: in the middle, at the median, or by the surface area heuristic
[Bentley1975, MacDonald1990, Wald2006].

A primitive belongs to every cell that it reaches into. Leaves hold copies of their
primitives side by side, so that 16 are tested at a time. Hence no mailboxes: they would
save 11 to 16 % of the tests, but all tests of a leaf in one leaf of a thousand (bumpy
sphere, random triangles; SAH).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.kd_tree.kd_tree_build import build_kd_arrays
from renderer.accelerators.kd_tree.kd_tree_checks import validate_kd_arrays
from renderer.accelerators.kd_tree.kd_tree_nodes import LEAF
from renderer.accelerators.kd_tree.kd_tree_split import CHEAPEST, MEDIAN, MIDDLE
from renderer.accelerators.rays.ray_by_ray import trace_ray
from renderer.accelerators.rays.ray_interval import interval_in_box, starts_beyond
from renderer.accelerators.rays.single_ray import nearest_in_range, nearest_of_all
from renderer.accelerators.references import boxes_of, hulls_of
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.records.tally import BOXES, NODES, add_to, note_stack
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

STACK = 64  # the builder keeps the depth at 60 or below


class KdTree(NamedTuple):
    """Nodes of eight bytes, siblings side by side, and the leaves' primitives."""

    bounds: NDArray[np.float32]  # (6,) the root's cell: lower x y z, upper x y z
    # Both are views of the same memory: split[2 k] and link[2 k + 1] belong to node k.
    split: NDArray[np.float32]  # (2 nodes,) inner nodes: coordinate of the plane
    # (2 nodes,) inner nodes: 4 (first of two children) + axis; leaves: 4 (leaf number) + 3
    link: NDArray[np.int32]
    first: NDArray[np.int32]  # (leaves + 1,) leaf l holds items[first[l] : first[l + 1]]
    items: NDArray[np.int32]  # columns of the builder's primitives, leaf by leaf
    primitives: Any  # a group of one kind: the primitives that `items` names
    reach: float  # rays from beyond test all primitives


def build_kd_middle(extents: Extents, group: PrimitiveGroup) -> KdTree:
    """Split in the middle of the longest axis."""
    return _build(extents, group, MIDDLE)


def build_kd_median(extents: Extents, group: PrimitiveGroup) -> KdTree:
    """Split at the median of the primitives on the longest axis."""
    return _build(extents, group, MEDIAN)


def build_kd_sah(extents: Extents, group: PrimitiveGroup) -> KdTree:
    """Split by the surface area heuristic."""
    return _build(extents, group, CHEAPEST)


def _build(extents: Extents, group: PrimitiveGroup, rule: int) -> KdTree:
    boxes = boxes_of(extents)
    bounds = np.concatenate((boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)))
    nodes, first, items = build_kd_arrays(boxes, hulls_of(extents), bounds, rule)
    return KdTree(
        bounds,
        nodes.view(np.float32).ravel(),
        nodes.ravel(),
        first,
        items,
        group(items.astype(np.int64)),
        extents.reach,
    )


def validate_kd_tree(tree: KdTree, extents: Extents) -> None:
    """Check that a tree is one and that each cell holds whatever reaches into it.

    Raises
    ------
    ValueError
        If not; the message says which node or leaf, and what is wrong with it.
    """
    validate_kd_arrays(tree, extents)


# ------------------------------------------------------------------------ the traversal


@trace_ray.by(KdTree)
@kernel
def _trace_kd_tree(tree, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""
    primitives = tree.primitives
    if starts_beyond(tree.reach, origin):
        return nearest_of_all(primitives, origin, direction, hit, tally, i)
    inverse = np.float32(1.0) / direction
    enter, leave = interval_in_box(tree.bounds, origin, inverse, hit.t)
    if not enter <= leave:
        return hit
    start, scale = local_f32(3), local_f32(3)
    start[0], start[1], start[2] = origin.x, origin.y, origin.z
    scale[0], scale[1], scale[2] = inverse.x, inverse.y, inverse.z
    waiting, ends = local_i32(STACK), local_f32(STACK)
    node, depth = np.int64(0), 0
    while True:
        leaf, leave, depth = _leaf_at(
            tree, node, enter, leave, start, scale, waiting, ends, depth, tally, i
        )
        begin, end = np.int64(tree.first[leaf]), np.int64(tree.first[leaf + 1])
        hit = nearest_in_range(primitives, begin, end, origin, direction, hit, tally, i)
        if depth == 0 or leave > hit.t or (any_will_do != 0 and hit.prim >= 0):
            return hit
        depth -= 1
        node, enter, leave = np.int64(waiting[depth]), leave, ends[depth]


@kernel
def _leaf_at(tree, node, enter, leave, start, scale, waiting, ends, depth, tally, i):
    """Go down from `node` to the leaf where a ray enters; return (leaf, leave, depth).

    The ray is in the node from `enter` to `leave`. A plane cuts that interval in two, and
    then the far child waits, or all of it lies on one side. It does not matter to which
    side a point within rounding of a plane goes, for what lies there is in both children:
    so neither do equal distances, nor the NaN of a ray in the plane (0 * inf).
    """
    while True:
        add_to(tally, NODES, i, 1)
        link = np.int64(tree.link[2 * node + 1])
        axis = link & 3
        if axis == LEAF:
            return link >> 2, leave, depth
        add_to(tally, BOXES, i, 1)
        cut = (tree.split[2 * node] - start[axis]) * scale[axis]
        node = link >> 2
        far = node + 1
        if scale[axis] < 0.0:
            node, far = far, node
        if cut < leave:
            if cut > enter:
                waiting[depth] = far
                ends[depth] = leave
                depth += 1
                note_stack(tally, i, depth)
                leave = cut
            else:
                node = far
