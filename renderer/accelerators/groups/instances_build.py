"""From the scene's groups and instances to the record that rays are traced through."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.bvh_tree import BvhTree, validate_bvh
from renderer.accelerators.extents import ROUNDING
from renderer.accelerators.groups.instances import Forest, Instances
from renderer.scene.placed_groups import distortion, linear_part, translation
from renderer.scene.scene import KINDS, Scene, primitive_bounds

# Seen from the world, an object's point is off by the rounding of the ray's way into the
# object's space (4 units in the last place of the origin, 3 of the direction, which goes up
# to twice as far) and of the hit test there (ROUNDING, 32 units); 2 are for the box itself.
_PAD = 44.0 / 32.0 * float(ROUNDING)

# kind, record, columns -> the group of those primitives, in that order
MakeGroup = Callable[[str, Any, NDArray[np.int64]], Any]


def build_instances(
    scene: Scene, make_group: MakeGroup, reach: float, *, brute: bool = False
) -> Instances | None:
    """Build the tree over the instances and those of the groups; None without instances.

    Parameters
    ----------
    scene : Scene
        Its groups and instances.
    make_group : callable
        Makes the arrays of a kind's primitives.
    reach : float
        Rays start where |x| + |y| + |z| is not more than this; others are slow.
    brute : bool
        Build no tree: each ray tests all instances, and all primitives of each. The truth
        for tests.
    """
    if scene.placements is None:
        return None
    reach = float(np.float32(1.01 * reach))
    lower, upper = padded_boxes(scene, reach)
    tree = _one_leaf(lower.shape[1]) if brute else build_tree(lower, upper, leaf_size=1)
    # a leaf of one instance can name it itself
    leaf = tree.count > 0
    child = np.where(leaf, tree.order[np.where(leaf, tree.child, 0)], tree.child)
    every = _one_leaf(lower.shape[1])
    forests = {
        kind: _forest(scene, kind, make_group, brute) if kind in scene.surfaces else None
        for kind in KINDS
    }
    return Instances(
        np.concatenate((tree.bounds, every.bounds)),
        np.concatenate((child, every.child)).astype(np.int32),
        np.concatenate((tree.count, every.count)),
        -1.0 if brute else reach,
        len(tree.child),
        scene.placements,
        **forests,
    )


def padded_boxes(
    scene: Scene, reach: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return lower and upper corners of boxes in which rays find the instances, (3, n).

    A point that is computed in the object's space is off by a few units in the last place
    of the distances that went into it: of the ray's origin to the instance, at most
    reach + |a|. The transform may enlarge that (`distortion`), by up to 3 for a rotation.
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


def _one_leaf(count: int) -> BvhTree:
    """Return the tree that is a leaf without bounds."""
    bounds = np.array([[-np.inf] * 3 + [np.inf] * 3], np.float32)
    numbers = np.array([count], np.int32)
    return BvhTree(bounds, numbers * 0, numbers, np.arange(count, dtype=np.int32))


def _forest(scene: Scene, kind: str, make_group: MakeGroup, brute: bool) -> Forest | None:
    """Return one tree for each group that has primitives of a kind; None if none has."""
    surfaces, starts = scene.surfaces[kind], scene.starts[kind]
    if starts[0] == starts[-1]:
        return None
    lower, upper = primitive_bounds(kind, surfaces)
    root = np.full(len(starts) - 1, -1, np.int32)
    bounds, children, counts, orders = [], [], [], []
    nodes = 0
    for group, (first, end) in enumerate(pairwise(starts)):
        if first == end:
            continue
        size = int(end - first)
        tree = (
            _one_leaf(size)
            if brute
            else build_tree(lower[:, first:end], upper[:, first:end])
        )
        root[group] = nodes
        shift = np.where(tree.count > 0, first - starts[0], nodes)
        bounds.append(tree.bounds)
        children.append(tree.child + shift)
        counts.append(tree.count)
        orders.append(tree.order + first)
        nodes += len(tree.child)
    columns = np.concatenate(orders).astype(np.int64)
    trees = Bvh(
        np.concatenate(bounds),
        np.concatenate(children).astype(np.int32),
        np.concatenate(counts),
        make_group(kind, surfaces, columns),
    )
    return Forest(trees, root)


# -------------------------------------------------------------------------- validation


def validate_instances(instances: Instances, scene: Scene) -> None:
    """Check that each group's trees hold its primitives, and the upper tree the instances.

    Raises
    ------
    ValueError
        If not; the message says which group, node or primitive.
    """
    assert scene.placements is not None
    for kind, surfaces in scene.surfaces.items():
        forest, starts = getattr(instances, kind), scene.starts[kind]
        lower, upper = primitive_bounds(kind, surfaces)
        for group, (first, end) in enumerate(pairwise(starts)):
            root = -1 if forest is None else int(forest.root[group])
            if (root < 0) != (first == end):
                raise ValueError(
                    f"group {group} has {end - first} {kind}, but its root is {root}"
                )
            if root >= 0:
                try:
                    tree = _tree_at(forest, root, int(first), surfaces.first)
                    validate_bvh(tree, lower[:, first:end], upper[:, first:end])
                except ValueError as error:
                    raise ValueError(f"{kind} of group {group}: {error}") from None
    _validate_upper(instances, scene)


def _tree_at(forest: Forest, root: int, first: int, first_id: int) -> BvhTree:
    """Return a group's tree by itself, its primitives counted from 0."""
    trees = forest.trees
    later = forest.root[forest.root > root]
    nodes = slice(root, int(later.min()) if later.size else len(trees.child))
    count, child = trees.count[nodes], trees.child[nodes]
    leaf = count > 0
    begin = int(child[leaf].min())
    ids = trees.primitives.id[begin : begin + int(count.sum())] - first_id - first
    return BvhTree(
        trees.bounds[nodes], np.where(leaf, child - begin, child - root), count, ids
    )


def _validate_upper(instances: Instances, scene: Scene) -> None:
    """Check that boxes hold every placed primitive, and that all instances are there."""
    placements = scene.placements
    assert placements is not None
    size = len(placements.group)
    if instances.every == 1 and instances.count[0] == size:
        return  # one leaf without bounds
    lower, upper = np.full((2, 3, size), np.inf)
    upper *= -1.0
    every = zip(
        linear_part(placements.to_world), translation(placements.to_world), strict=True
    )
    kinds = [(primitive_bounds(k, s), scene.starts[k]) for k, s in scene.surfaces.items()]
    for number, (linear, at) in enumerate(every):
        group = placements.group[number]
        for (low, high), starts in kinds:
            mine = slice(starts[group], starts[group + 1])
            if mine.start < mine.stop:
                middle = linear @ (0.5 * (low[:, mine] + high[:, mine])) + at[:, None]
                half = np.abs(linear) @ (0.5 * (high[:, mine] - low[:, mine]))
                lower[:, number] = np.minimum(lower[:, number], (middle - half).min(axis=1))
                upper[:, number] = np.maximum(upper[:, number], (middle + half).max(axis=1))
    nodes = slice(0, instances.every)
    tree = BvhTree(
        instances.bounds[nodes],
        instances.child[nodes],
        instances.count[nodes],
        np.arange(size, dtype=np.int32),
    )
    validate_bvh(tree, lower.astype(np.float32), upper.astype(np.float32))
