"""Bounding volume hierarchy: a binary tree of boxes, whose leaves hold primitives.

Each primitive is in one leaf. Boxes may overlap, so a hit does not end the traversal:
another box may hold a nearer one. A box that the ray enters behind the hit is skipped.

The split rules are those of the kd-tree, applied to the primitives' centres: half of them
to each side, the middle of the longest side, or the least expected cost by the surface area
heuristic. The production builder has all three (`accelerators/bvh/bvh_build.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import local_f32, local_i32
from renderer.kernels.records.batch import BOXES, NODES, add_to, note_stack
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.cell_tree import MARGIN, STACK
from renderer.textbook.one_ray import interval_in_box, test_items, trace_ray


class BoxTree(NamedTuple):
    """Nodes and leaves; node 0 is the root."""

    boxes: NDArray[np.float32]  # (nodes, 6) lower x y z, upper x y z; padded by `MARGIN`
    child: NDArray[np.int32]  # (nodes,) first of two children; 0: a leaf
    first: NDArray[np.int32]  # (nodes,) a leaf holds items[first : end]
    end: NDArray[np.int32]  # (nodes,)
    items: NDArray[np.int32]  # (n,) columns of `primitives`, leaf by leaf
    reach: np.float32  # rays from farther away test all primitives
    primitives: Any  # a group of one kind, in the scene's order


def build_box_tree(
    extents: Extents, group: PrimitiveGroup, build_tree: Callable[..., Any]
) -> BoxTree:
    """Build over boxes that are padded by `MARGIN` pads.

    `build_tree(lower, upper)` returns the arrays of a binary tree: `bounds` of nodes,
    `child` (first child, or first primitive of a leaf), `count` (number of a leaf's
    primitives; 0: an inner node) and `order`, the primitives leaf by leaf.
    """
    margin = np.float32(MARGIN * extents.pad)
    tree = build_tree(extents.lower - margin, extents.upper + margin)
    return BoxTree(
        tree.bounds,
        np.where(tree.count == 0, tree.child, 0),
        tree.child,
        tree.child + tree.count,
        tree.order,
        np.float32(extents.reach),
        group(np.arange(len(tree.order))),
    )


@trace_ray.by(BoxTree)
@kernel
def _trace_box_tree(tree, ray, hit, any_hit, tally, i):
    """Return the nearest hit of one ray, or the first hit found."""
    # the stack: nodes, and t where the ray enters their boxes
    nodes, enters = local_i32(STACK), local_f32(STACK)
    depth = _push(tree, np.int64(0), ray, hit, nodes, enters, np.int64(0), tally, i)
    while depth > 0:
        note_stack(tally, i, depth)
        depth -= 1
        if enters[depth] > hit.t:  # the hit is before the box
            continue
        node = np.int64(nodes[depth])
        add_to(tally, NODES, i, 1)
        child = np.int64(tree.child[node])
        if child == 0:
            begin, end = np.int64(tree.first[node]), np.int64(tree.end[node])
            hit = test_items(tree, begin, end, ray, hit, any_hit, tally, i)
            if any_hit != 0 and hit.prim >= 0:
                return hit
            continue
        before = depth
        depth = _push(tree, child, ray, hit, nodes, enters, depth, tally, i)
        depth = _push(tree, child + 1, ray, hit, nodes, enters, depth, tally, i)
        if depth == before + 2 and enters[before] < enters[before + 1]:
            # the nearer child goes on top of the stack
            nodes[before], nodes[before + 1] = nodes[before + 1], nodes[before]
            enters[before], enters[before + 1] = enters[before + 1], enters[before]
    return hit


@kernel
def _push(tree, node, ray, hit, nodes, enters, depth, tally, i):
    """Push a node if the ray enters its box before the hit; return the new depth."""
    add_to(tally, BOXES, i, 1)
    enter, leave = interval_in_box(tree.boxes[node], ray, hit.t)
    if not enter <= leave:
        return depth
    nodes[depth], enters[depth] = node, enter
    return depth + 1
