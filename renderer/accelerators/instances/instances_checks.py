"""Checks of the trees over instances and groups: they reach all that they hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.wide.wide_bvh_build import CHILD, WIDE_BYTES, WIDE_WORDS
from renderer.accelerators.bvh.wide.wide_bvh_checks import validate_wide_nodes
from renderer.accelerators.instances.instance_streams import (
    END,
    FIRST,
    KIND,
    LEAF_WORDS,
    TOGETHER,
    of_kind,
)
from renderer.accelerators.instances.instances import Instances
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.scene.placed_groups import linear_part, translation
from renderer.scene.scene import KINDS, Scene


def validate_instances(instances: Instances, scene: Scene) -> None:
    """Check that each group's tree holds its primitives, and the top tree the instances.

    Raises
    ------
    ValueError
        Otherwise; the message says which group, node or primitive.
    """
    assert scene.placements is not None
    roots = instances.root
    trees = np.unique(roots[roots >= 0])
    if instances.reach >= 0.0:
        _validate_tree(instances, 0, trees, 0, *_instance_boxes(scene))
    for group in np.unique(scene.placements.group):
        mine = np.unique(roots[scene.placements.group == group])
        if len(mine) != 1:
            raise ValueError(f"group {group} has {len(mine)} roots")
        _validate_group(instances, scene, int(group), int(mine[0]), trees)


def _validate_group(
    instances: Instances, scene: Scene, group: int, root: int, trees: NDArray[Any]
) -> None:
    """Check that a group's leaves hold its primitives once, and its boxes its leaves."""
    size = len(instances.root)
    leaves = instances.leaves.reshape(-1, LEAF_WORDS)
    if root < 0:
        begin = ~root - size
        reached = np.arange(begin, begin + leaves[begin, TOGETHER])
    else:
        children = _nodes_of(instances, root, trees).view(np.int32)[:, CHILD : CHILD + 8]
        reached = np.sort(~children[children < 0] - size)
    lower, upper = np.full((2, len(reached), 3), np.inf)
    upper *= -1.0
    found: dict[str, list[Any]] = {kind: [] for kind in KINDS}
    for k, leaf in enumerate(leaves[reached]):
        kind = KINDS[leaf[KIND]]
        ids = of_kind(instances.primitives, leaf[KIND]).id[leaf[FIRST] : leaf[END]]
        found[kind].append(ids)
        column = ids - scene.surfaces[kind].first
        low, high = primitive_bounds(kind, scene.surfaces[kind])
        lower[k], upper[k] = low[:, column].min(axis=1), high[:, column].max(axis=1)
    for kind, surfaces in scene.surfaces.items():
        first, end = scene.starts[kind][group : group + 2] + surfaces.first
        held = np.sort(np.concatenate([np.zeros(0, np.int64), *found[kind]]))
        if not np.array_equal(held, np.arange(first, end)):
            raise ValueError(f"{kind} of group {group}: its leaves hold others")
    if root >= 0:
        _validate_tree(instances, root, trees, size + int(reached[0]), lower, upper)


def _nodes_of(instances: Instances, root: int, trees: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the nodes of one tree, which are contiguous, as rows."""
    nodes = instances.octets.reshape(-1, WIDE_BYTES)
    later = trees[trees > root]
    return nodes[root : later[0] if later.size else len(nodes)]


def _validate_tree(
    instances: Instances,
    root: int,
    trees: NDArray[Any],
    first: int,
    lower: NDArray[Any],
    upper: NDArray[Any],
) -> None:
    """Check one tree, with its nodes and leaves numbered from 0."""
    nodes = _nodes_of(instances, root, trees).copy()
    children = nodes.view(np.int32).reshape(-1, WIDE_WORDS)[:, CHILD : CHILD + 8]
    children[children > 0] -= root
    children[children < 0] += first
    try:
        validate_wide_nodes(nodes, lower, upper)
    except ValueError as error:
        raise ValueError(f"tree at node {root}: {error}") from None


def _instance_boxes(scene: Scene) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return (n, 3) corners of boxes around each instance's transformed primitives."""
    placements = scene.placements
    assert placements is not None
    lower, upper = np.full((2, len(placements.group), 3), np.inf)
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
                lower[number] = np.minimum(lower[number], (middle - half).min(axis=1))
                upper[number] = np.maximum(upper[number], (middle + half).max(axis=1))
    return lower, upper
