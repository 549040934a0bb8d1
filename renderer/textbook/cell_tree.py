"""A tree of cells: space is divided recursively by planes, and traversed front to back.

A kd-tree is a BSP tree with axis-aligned planes, and an octree cuts a cell by three such
planes at once. So all three share this record and this traversal; their builders choose
different planes (`kd_tree.py`, `octree.py`, `bsp.py`).

Cells do not overlap. A ray visits the near half first and pushes the far half on a stack
[Fuchs1980]. A hit before all stacked halves ends the ray. A primitive is in the list of
every leaf whose cell it reaches into.

Single precision is safe. For an origin within `reach`, the rounded distances of a ray's
origin and direction to a plane displace a point of the ray by less than 16 units in the
last place of `reach`, which is half a pad. A hit is displaced by one pad at most. The
builder grows boxes and hulls by `MARGIN` = 2 pads, of which `PROVEN` = 1.5 are needed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import local_f32, local_i32
from renderer.kernels.records.batch import BOXES, NODES, add_to, note_stack
from renderer.textbook.one_ray import interval_in_box, test_items, trace_ray

MAX_DEPTH = 60  # edges from the root to the deepest leaf
STACK = 64  # stacked halves: at most one per edge on the way down
MARGIN, PROVEN = 2.0, 1.5  # pads
_INFINITY = np.float32(np.inf)


class CellTree(NamedTuple):
    """Nodes and leaves; node 0 is the root."""

    plane: NDArray[np.float32]  # (nodes, 4) unit normal and offset: normal . x = offset
    child: NDArray[np.int32]  # (nodes,) the node behind, the next is in front; 0: a leaf
    first: NDArray[np.int32]  # (nodes,) a leaf holds items[first : end]
    end: NDArray[np.int32]  # (nodes,)
    items: NDArray[np.int32]  # columns of `primitives`, leaf by leaf
    bounds: NDArray[np.float32]  # (6,) of all primitives: lower x y z, upper x y z
    reach: np.float32  # rays from farther away test all primitives
    primitives: Any  # a group of one kind, in the scene's order


@trace_ray.by(CellTree)
@kernel
def _trace_cell_tree(tree, ray, hit, any_hit, tally, i):
    """Return the nearest hit of one ray, or the first hit found."""
    add_to(tally, BOXES, i, 1)
    enter, leave = interval_in_box(tree.bounds, ray, hit.t)
    if not enter <= leave:
        return hit
    # the stack: nodes, and t where the ray enters and leaves each
    nodes, enters, leaves = local_i32(STACK), local_f32(STACK), local_f32(STACK)
    node, depth = np.int64(0), np.int64(0)
    while True:
        add_to(tally, NODES, i, 1)
        if tree.child[node] > 0:
            add_to(tally, BOXES, i, 1)
            t, near, far = _crossing(tree, node, ray)
            if t < enter:  # the ray crosses the plane before it enters the cell
                node = far
            elif t > leave:  # the ray ends or leaves the cell before it crosses
                node = near
            else:
                nodes[depth], enters[depth], leaves[depth] = far, t, leave
                depth += 1
                note_stack(tally, i, depth)
                node, leave = near, t
            continue
        begin, end = np.int64(tree.first[node]), np.int64(tree.end[node])
        hit = test_items(tree, begin, end, ray, hit, any_hit, tally, i)
        if depth == 0 or (any_hit != 0 and hit.prim >= 0):
            return hit
        depth -= 1
        node, enter, leave = np.int64(nodes[depth]), enters[depth], leaves[depth]
        # all stacked halves begin here or later; at enter = hit.t there may be a tie
        leave = min(leave, hit.t)
        if enter > leave:
            return hit


@kernel
def _crossing(tree, node, ray):
    """Return t where a ray crosses a node's plane, and the halves before and behind it.

    A ray parallel to the plane never leaves its half. For a ray in the plane either half
    will do: primitives so close to the plane are in both.
    """
    plane, o, d = tree.plane, ray.origin, ray.direction
    x, y, z = plane[node, 0], plane[node, 1], plane[node, 2]
    away = x * o.x + y * o.y + z * o.z - plane[node, 3]
    speed = x * d.x + y * d.y + z * d.z
    behind = np.int64(tree.child[node])
    in_front = behind + 1
    if speed == 0.0:
        if away > 0.0:
            return _INFINITY, in_front, behind
        return _INFINITY, behind, in_front
    if speed < 0.0:
        return -away / speed, in_front, behind
    return -away / speed, behind, in_front


# ------------------------------------------------------------------- properties of a tree


def cells_of(tree: CellTree) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the cells (nodes, 6) and depths (nodes,) of the nodes of a valid tree.

    If a plane is not axis-aligned, both children get the whole box of their parent.
    """
    cells = np.empty((len(tree.child), 6), np.float32)
    cells[0] = tree.bounds
    depth = np.zeros(len(tree.child), np.int64)
    level = np.zeros(1, np.int64)
    while (level := level[tree.child[level] > 0]).size:
        behind = tree.child[level].astype(np.int64)
        cells[behind] = cells[behind + 1] = cells[level]
        depth[behind] = depth[behind + 1] = depth[level] + 1
        for axis in range(3):
            across = tree.plane[level, axis] == 1.0
            offset = tree.plane[level[across], 3]
            cells[behind[across], axis + 3] = offset
            cells[behind[across] + 1, axis] = offset
        level = np.concatenate((behind, behind + 1))
    return cells, depth


def tree_cost(tree: CellTree, step: float = 1.0, test: float = 2.0) -> float | None:
    """Return the expected cost of a ray that hits the root, by the surface area heuristic.

    `step` is the cost of a step down the tree, `test` that of a primitive test
    [MacDonald1990]. None for a tree with planes that are not axis-aligned.
    """
    if (tree.plane[tree.child > 0, :3].max(axis=1) < 1.0).any():
        return None
    cells, _ = cells_of(tree)
    a, b, c = (cells[:, 3:].astype(np.float64) - cells[:, :3]).T
    area = a * b + b * c + c * a
    share = area / area[0] if area[0] > 0 else np.ones_like(area)
    tests = (tree.end - tree.first) * test
    return float(np.sum(share * np.where(tree.child > 0, step, tests)))
