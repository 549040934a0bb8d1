"""Build the record of instances and groups that rays are traced through."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.bvh_tree import BvhTree
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    CHILD,
    WIDE_WORDS,
    collapse,
    far_to_near,
)
from renderer.accelerators.instances.instance_streams import primitives_of
from renderer.accelerators.instances.instances import Instances
from renderer.plugins.shapes.blocks import WIDTH, aligned_bytes, blocks_of
from renderer.plugins.shapes.extents import ROUNDING, primitive_bounds
from renderer.plugins.shapes.registry import SHAPES
from renderer.scene.placed_groups import distortion, translation
from renderer.scene.scene import KINDS, Scene

# Box padding, in units in the last place. In the world, a point in object space is off by
# the rounding of the ray's transform (4 of the origin, 3 of the direction, which reaches
# up to twice as far) and of the hit test there (ROUNDING, 32). 2 are for the box itself.
_PAD = 44.0 / 32.0 * float(ROUNDING)

# A group of no more primitives has no tree: the instance's box culls well enough.
FEW = 8

# kind, record, columns -> the group of those primitives, in that order
MakeGroup = Callable[[str, Any, NDArray[np.int64]], Any]


def build_instances(
    scene: Scene, make_group: MakeGroup, reach: float, *, brute: bool = False
) -> Instances | None:
    """Build the tree over the instances and the groups' trees; None without instances.

    Parameters
    ----------
    scene : Scene
        Its groups and instances.
    make_group : callable
        Makes the primitive group of a kind.
    reach : float
        Largest |x| + |y| + |z| of ray origins for which boxes are padded; others are slow.
    brute : bool
        Build no tree: each ray tests all instances and all their primitives. The
        reference for tests.
    """
    if scene.placements is None:
        return None
    reach = float(np.float32(1.01 * reach))
    parts = _Parts(scene)
    if not brute:
        lower, upper = padded_boxes(scene, reach)
        tree = build_tree(lower, upper, leaf_size=1)
        leaf = tree.count > 0
        child = tree.child.copy()
        child[leaf] = WIDTH * tree.order[child[leaf]]
        parts.add_nodes(tree._replace(child=child))
    groups = len(next(iter(scene.starts.values()))) - 1
    root = np.array([parts.add_group(k, brute) for k in range(groups)], np.int32)
    octets = parts.octets()
    return Instances(
        octets.view(np.float32),
        octets.view(np.int32),
        octets,
        np.concatenate(parts.orders),
        root[scene.placements.group],
        np.array(parts.leaves, np.int32).ravel(),
        -1.0 if brute else reach,
        scene.placements,
        parts.primitives(make_group),
    )


def build_nodes(tree: BvhTree) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Return the nodes of eight, and the order of their children."""
    octets, _ = collapse(tree.bounds, tree.child, tree.count)
    return octets, far_to_near(octets.view(np.float32), octets.view(np.int32), octets)


class _Parts:
    """The nodes, leaves and primitives of all groups, in sequence."""

    def __init__(self, scene: Scene) -> None:
        assert scene.placements is not None
        self.scene = scene
        self.instances = len(scene.placements.group)
        self.nodes: list[NDArray[np.int32]] = []  # (n, 32) each
        self.node_count = 0
        self.orders: list[NDArray[np.int32]] = [np.zeros(0, np.int32)]  # (8 n,) each
        self.leaves: list[tuple[int, int, int, int]] = []
        self.columns: dict[str, list[NDArray[np.int64]]] = {kind: [] for kind in KINDS}
        self.column_count = dict.fromkeys(KINDS, 0)
        self.bounds = {k: primitive_bounds(k, s) for k, s in scene.surfaces.items()}

    def add_nodes(self, tree: BvhTree) -> int:
        """Add a binary tree as nodes of eight; a leaf's `child` 8 k is stored as ~k."""
        octets, order = build_nodes(tree)
        nodes = octets.view(np.int32).reshape(-1, WIDE_WORDS)
        first = self.node_count
        self.node_count += len(nodes)
        child = nodes[:, CHILD : CHILD + 8]
        child[child > 0] += first
        self.nodes.append(nodes)
        self.orders.append(order)
        return first

    def add_group(self, group: int, brute: bool) -> int:
        """Add the primitives of a group; return its root, a node or ~leaf."""
        trees = []
        spans = {k: s[group : group + 2] for k, s in self.scene.starts.items()}
        few = brute or sum(end - first for first, end in spans.values()) <= FEW
        begin = len(self.leaves)
        for kind, (first, end) in spans.items():
            if first < end:
                lower, upper = (side[:, first:end] for side in self.bounds[kind])
                tree = one_leaf(end - first) if few else build_tree(lower, upper)
                trees.append(self._with_leaves(kind, int(first), tree))
        if not trees:  # an empty group
            self.leaves.append((0, 0, 0, 1))
        if few:
            together = len(self.leaves) - begin
            self.leaves[begin] = (*self.leaves[begin][:3], together)
            return ~(self.instances + begin)
        while len(trees) > 1:
            trees.append(_joined(trees.pop(0), trees.pop(0)))
        return self.add_nodes(trees[0])

    def _with_leaves(self, kind: str, first: int, tree: BvhTree) -> BvhTree:
        """Add the leaves of a tree of one kind; return the tree with leaf numbers."""
        child = tree.child.copy()
        columns, start = self.columns[kind], self.column_count[kind]
        for node in np.flatnonzero(tree.count):
            count = int(tree.count[node])
            mine = np.full(-(-count // WIDTH) * WIDTH, -1, np.int64)
            mine[:count] = first + tree.order[tree.child[node] : tree.child[node] + count]
            columns.append(mine)
            child[node] = WIDTH * (self.instances + len(self.leaves))
            self.leaves.append((start, start + count, KINDS.index(kind), 1))
            start += len(mine)
        self.column_count[kind] = start
        return tree._replace(child=child)

    def octets(self) -> NDArray[np.uint8]:
        """Return all nodes in memory aligned to a pair of cache lines."""
        nodes = np.concatenate([np.zeros((0, WIDE_WORDS), np.int32), *self.nodes])
        memory = aligned_bytes(max(nodes.nbytes, 4 * WIDE_WORDS))
        memory[: nodes.nbytes] = nodes.view(np.uint8).ravel()
        return memory

    def primitives(self, make_group: MakeGroup) -> Any:
        """Return the primitives of each kind in the order of the leaves."""
        blocks: list[Any] = [None] * len(KINDS)
        singles: list[Any] = [None] * len(KINDS)
        for k, kind in enumerate(KINDS):
            if not self.columns[kind]:
                continue
            columns = np.concatenate(self.columns[kind])
            group = functools.partial(make_group, kind, self.scene.surfaces[kind])
            if SHAPES[kind].wide:
                blocks[k] = blocks_of(group, columns)
            else:
                singles[k] = group(np.maximum(columns, 0))
        return primitives_of(blocks, singles)


def _joined(a: BvhTree, b: BvhTree) -> BvhTree:
    """Join two trees: their roots become the children of a new root."""
    bounds = np.concatenate((a.bounds[:1], a.bounds[:1], b.bounds[:1], a.bounds[1:]))
    bounds = np.concatenate((bounds, b.bounds[1:]))
    bounds[0, :3] = np.minimum(a.bounds[0, :3], b.bounds[0, :3])
    bounds[0, 3:] = np.maximum(a.bounds[0, 3:], b.bounds[0, 3:])
    moved = [
        np.where(tree.count == 0, tree.child + shift, tree.child)
        for tree, shift in ((a, 2), (b, len(a.child) + 1))
    ]

    def laid(root: int, first: Any, second: Any) -> NDArray[np.int32]:
        parts = ([root], first[:1], second[:1], first[1:], second[1:])
        return np.concatenate(parts).astype(np.int32)

    return BvhTree(bounds, laid(1, *moved), laid(0, a.count, b.count), a.order)


def one_leaf(count: int) -> BvhTree:
    """Return a tree that is a single leaf without bounds."""
    bounds = np.array([[-np.inf] * 3 + [np.inf] * 3], np.float32)
    numbers = np.array([count], np.int32)
    return BvhTree(bounds, numbers * 0, numbers, np.arange(count, dtype=np.int32))


def padded_boxes(
    scene: Scene, reach: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return lower and upper corners (3, n) of the instances' boxes, padded for rounding.

    A point in object space is off by a few units in the last place of the distances that
    it was computed from: at most reach + |a|, from the ray's origin to the instance. The
    transform may enlarge that (`distortion`), by up to 3 for a rotation.
    """
    assert scene.placements is not None and scene.instance_boxes is not None
    away = reach + np.abs(translation(scene.placements.to_world)).sum(axis=1)
    pad = _PAD * distortion(scene.placements).T * away
    lower, upper = scene.instance_boxes
    down, up = np.float32(-np.inf), np.float32(np.inf)
    return (
        np.nextafter((lower - pad).astype(np.float32), down),
        np.nextafter((upper + pad).astype(np.float32), up),
    )
