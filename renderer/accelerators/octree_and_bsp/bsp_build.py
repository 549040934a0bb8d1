"""Choosing the planes of a binary space partitioning tree, and sharing out the primitives.

Candidates for a node's plane come from `SAMPLES` of its primitives, evenly spread over its
list: the plane of each polygon, and planes through faces of its box. The polygons' own
planes are what the method is known for [Fuchs1980], but they are not enough: every plane
of a convex mesh leaves the whole mesh on one side. With n_b primitives only behind a plane,
n_f only in front and n_s on both sides, the rule is

    cost = (n_b + n_s)^2 + (n_f + n_s)^2        against (n_b + n_f + n_s)^2 for a leaf

which is least for a plane that halves the node and cuts nothing. The areas that the surface
area heuristic asks for are not at hand: cells of general planes are no boxes. (Areas of the
boxes around what lies on either side, put in as weights, saved less than a tenth of the
tests.) So empty space is never cut off, and rays test what lies elsewhere in their cells:
on the teapot a camera ray visits 78 nodes and makes 174 tests.

The builder is one thread, without recursion, and always builds the same tree.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import builder_kernel, kernel
from renderer.plugins.shapes.extents import Extents

LEAF = 4  # up to so many primitives are not divided further
MAX_DEPTH = 60  # edges from the root to the deepest leaf; sizes traversal stacks
# All leaves together name at most (1 + EXTRA) n primitives; there are at most twice as many
# nodes. What a node may add is shared among its children by their size.
EXTRA = 8
# Hulls are grown by so many pads: one for the rounding of hits, half of one for that of
# distances to a plane (`bsp.py`), the rest to spare.
MARGIN = 2.0

SAMPLES = 8  # primitives that offer planes
OFFERS = 4  # of each: its own plane, and one across each axis
TRIALS = 128  # primitives that a candidate is tried on
GAIN = 0.95  # what a plane costs at most, as a part of the leaf's cost


class BspTree(NamedTuple):
    """Planes and leaves; node 0 is the root."""

    plane: NDArray[np.float32]  # (nodes, 4) unit normal and offset: normal . x = offset
    child: NDArray[np.int32]  # (nodes,) inner: node behind, next: in front; leaf: see count
    # (nodes,) 0: inner; k > 0: leaf of items[child : child + k]
    count: NDArray[np.int32]  # type: ignore[assignment]  # tuple has a method count
    items: NDArray[np.int32]  # (references,) the leaves' primitives, leaf by leaf


def build_planes(extents: Extents) -> BspTree:
    """Build the tree over the hulls of n >= 1 primitives."""
    hulls = extents.points.transpose(2, 1, 0).astype(np.float64, order="C")
    grown = extents.radius.astype(np.float64) + MARGIN * extents.pad
    normals = extents.normal.T.astype(np.float64, order="C")
    nodes, references, plane, child, count, items = _build(
        hulls, grown, normals, extents.pad
    )
    return BspTree(
        plane[:nodes].copy(), child[:nodes].copy(), count[:nodes].copy(), items[:references]
    )


@builder_kernel
def _build(hulls, grown, normals, pad):
    """Return the numbers of nodes and references, and the arrays."""
    n = len(grown)
    most = (1 + EXTRA) * n
    plane = np.zeros((2 * most, 4), np.float32)
    child = np.empty(2 * most, np.int32)
    count = np.zeros(2 * most, np.int32)
    items = np.empty(most, np.int32)
    sides = np.empty(n, np.int8)
    behind = np.empty(n, np.int32)

    # `waiting` holds the lists of nodes that wait, in the order of the stack
    waiting = np.empty(most, np.int32)
    waiting[:n] = np.arange(n)
    # one waiting node for each level: (node, first, end, depth, references to spare)
    stack = np.empty((MAX_DEPTH + 2, 5), np.int64)
    stack[0] = (0, 0, n, 0, EXTRA * n)
    top = 1
    nodes = 1
    references = 0
    while top > 0:
        top -= 1
        node, first, end, depth, spare = stack[top]
        size = end - first

        # choose: leaf or split
        back = front = both = 0
        if size > LEAF and depth < MAX_DEPTH:
            split = _cheapest_plane(waiting, first, size, hulls, grown, normals, pad)
            if split[0] < GAIN:
                plane[node] = split[1:]
                back, front, both = _classify(
                    waiting, first, end, hulls, grown, plane[node], sides
                )
        if back + front == 0 or both > spare or _cost(back, front, both) >= GAIN:
            plane[node] = 0.0
            child[node] = references
            count[node] = size
            items[references : references + size] = waiting[first:end]
            references += size
            continue

        # in front below, behind on top: that is taken from the stack first
        middle, end = _share_out(waiting, first, end, sides, behind)
        spare -= both
        for_back = spare * (back + both) // (size + both)
        child[node] = nodes
        stack[top] = (nodes + 1, first, middle, depth + 1, spare - for_back)
        stack[top + 1] = (nodes, middle, end, depth + 1, for_back)
        top += 2
        nodes += 2
    return nodes, references, plane, child, count, items


@kernel
def _cost(back, front, both):
    """Return the cost of a split, as a part of that of a leaf."""
    size = np.float64(back + front + both)
    return ((back + both) ** 2 + (front + both) ** 2) / (size * size)


# ----------------------------------------------------------------------------- candidates


@kernel
def _cheapest_plane(waiting, first, size, hulls, grown, normals, pad):
    """Return (cost, normal x, y, z, offset) of the best candidate, the first of equals.

    Each is tried on `TRIALS` of the node's primitives, so that a node costs no more than
    its one pass of sharing out, however large it is.
    """
    best_cost = np.inf
    best = (np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0))
    stride = (size + TRIALS - 1) // TRIALS
    for offer in range(OFFERS):
        for sample in range(SAMPLES):
            k = waiting[first + (2 * sample + 1) * size // (2 * SAMPLES)]
            candidate = _offered(hulls, grown, normals, pad, k, offer, sample)
            back = front = both = 0
            for i in range(first, first + size, stride):
                side = _side(hulls, grown, waiting[i], candidate)
                back += side < 0
                front += side > 0
                both += side == 0
            cost = _cost(back, front, both)
            if cost < best_cost:
                best_cost = cost
                best = candidate
    return best_cost, best[0], best[1], best[2], best[3]


@kernel
def _offered(hulls, grown, normals, pad, k, offer, sample):
    """Return the plane (normal x, y, z, offset) that primitive k offers.

    It lies just outside of the primitive's grown hull, below or above it in turn: in the
    polygon itself it would have the polygon, and all others of that plane, on both sides.
    """
    x, y, z = normals[k, 0], normals[k, 1], normals[k, 2]
    if offer > 0 or (x == 0.0 and y == 0.0 and z == 0.0):
        axis = (offer - 1 if offer > 0 else sample) % 3
        x = 1.0 if axis == 0 else 0.0
        y = 1.0 if axis == 1 else 0.0
        z = 1.0 if axis == 2 else 0.0
    low, high = _span(hulls, k, x, y, z)
    beyond = grown[k] + pad  # pad: the offset is rounded
    # the curved offer the same axis twice, so the other face then
    below = (sample + (offer == 0)) % 2 == 0
    offset = low - beyond if below else high + beyond
    return np.float32(x), np.float32(y), np.float32(z), np.float32(offset)


@kernel
def _span(hulls, k, x, y, z):
    """Return the range of normal . point over the four points of a hull."""
    low = np.inf
    high = -np.inf
    for j in range(4):
        s = x * hulls[k, j, 0] + y * hulls[k, j, 1] + z * hulls[k, j, 2]
        low = min(low, s)
        high = max(high, s)
    return low, high


@kernel
def _side(hulls, grown, k, plane):
    """Return -1: all of a grown hull is behind a plane, 1: in front, 0: on both sides."""
    x, y, z = np.float64(plane[0]), np.float64(plane[1]), np.float64(plane[2])
    offset = np.float64(plane[3])
    low, high = _span(hulls, k, x, y, z)
    if high + grown[k] < offset:
        return -1
    if low - grown[k] > offset:
        return 1
    return 0


# -------------------------------------------------------------------------- the two halves


@kernel
def _classify(waiting, first, end, hulls, grown, plane, sides):
    """Write the side of each primitive of a node; return how many are on which."""
    back = front = both = 0
    for i in range(first, end):
        side = _side(hulls, grown, waiting[i], plane)
        sides[i - first] = side
        back += side < 0
        front += side > 0
        both += side == 0
    return back, front, both


@kernel
def _share_out(waiting, first, end, sides, behind):
    """Replace a node's list by that of its front child and then that of its back child.

    Returns where the second begins and ends. Both keep the primitives' order.
    """
    to_back = 0
    middle = first
    for i in range(first, end):
        k = waiting[i]
        if sides[i - first] <= 0:
            behind[to_back] = k
            to_back += 1
        if sides[i - first] >= 0:
            waiting[middle] = k
            middle += 1
    for i in range(to_back):
        waiting[middle + i] = behind[i]
    return middle, middle + to_back


# -------------------------------------------------------------------------------- proof


def require_nodes(tree: Any, reach: float) -> None:
    """Raise ValueError unless children, leaves and planes are right, each by itself.

    `tree` has the fields of a `BspTree`.
    """
    nodes = len(tree.child)
    if not nodes == len(tree.count) == len(tree.plane):
        raise ValueError("BSP arrays differ in length")
    inner = np.flatnonzero(tree.count == 0)
    first = tree.child[inner].astype(np.int64)
    _require_none(inner[first <= inner], "comes after its children")
    _require_none(inner[first + 1 >= nodes], "has children that do not exist")
    parents = np.bincount(np.concatenate((first, first + 1)), minlength=nodes)
    wrong = np.flatnonzero(parents[1:] != 1) + 1
    _require_none(wrong, "is not the child of exactly one node")
    leaves = np.flatnonzero(tree.count)
    start = tree.child[leaves].astype(np.int64)
    outside = (start < 0) | (tree.count[leaves] < 0)
    outside |= start + tree.count[leaves] > len(tree.items)
    _require_none(leaves[outside], "has items that do not exist")
    length = np.linalg.norm(tree.plane[inner, :3].astype(np.float64), axis=1)
    _require_none(inner[~(np.abs(length - 1.0) < 1e-6)], "has no unit normal")
    # what the bound on the rounding of distances rests on
    far = ~(np.abs(tree.plane[inner, 3]) <= 1.001 * reach)
    _require_none(inner[far], "has its plane out of reach")


def _require_none(nodes: NDArray[np.int64], fault: str) -> None:
    if nodes.size:
        raise ValueError(f"BSP node {nodes[0]} (of {nodes.size} such) {fault}")
