"""The cells or boxes of each structure, with their depth: what a drawing of it shows."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.bvh.wide_bvh import WideBvh
from renderer.accelerators.rays.boxes import Boxes
from renderer.plugins.shapes.blocks import WIDTH
from renderer.textbook.bounding_volumes import Aabb, BoundingSphere, Slabs
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree, cells_of
from renderer.textbook.grid_walk import Grids
from reports.trials.meshes import CORNERS

Edges = NDArray[np.float64]  # (m, 2 ends, 3)
CIRCLE = 48  # edges of a circle


class Cells(NamedTuple):
    """Cells or boxes; steps of a walk name them by their numbers."""

    boxes: NDArray[np.float64]  # (n, 6) lower x y z, upper x y z
    level: NDArray[np.int64]  # (n,) edges from the root
    held: NDArray[np.int64]  # (n,) triangles in it or below it; twice, if in two cells
    leaf: NDArray[np.bool_]  # (n,) nothing finer lies in it
    shown: NDArray[np.bool_]  # (n,) worth drawing: False for empty places and cells


@functools.singledispatch
def drawn_cells(accel: Any) -> Cells:
    """Return what is drawn of a structure; one box for none."""
    rows = accel.primitives
    return _cells([[*[-np.inf] * 3, *[np.inf] * 3]], [0], [rows.count], [True], [True])


def _cells(boxes: Any, level: Any, held: Any, leaf: Any, shown: Any) -> Cells:
    return Cells(
        np.asarray(boxes, np.float64),
        np.asarray(level, np.int64),
        np.asarray(held, np.int64),
        np.asarray(leaf, bool),
        np.asarray(shown, bool),
    )


@drawn_cells.register
def _boxes(accel: Boxes) -> Cells:
    n, held = len(accel.bounds), np.diff(accel.start)
    whole = [*accel.bounds[:, :3].min(axis=0), *accel.bounds[:, 3:].max(axis=0)]
    boxes = np.vstack((whole, accel.bounds))
    level = [0] + [1] * n
    return _cells(boxes, level, [held.sum(), *held], np.array(level) > 0, [True] * (n + 1))


def _binary(boxes: Any, child: Any, held: Any) -> Cells:
    """Return the nodes of a binary tree; `child` is 0 for leaves."""
    level = np.full(len(child), -1)
    held = np.where(child == 0, held, 0).astype(np.int64)
    levels: list[NDArray[np.int64]] = []
    nodes = np.zeros(1, np.int64)
    while nodes.size:
        level[nodes] = len(levels)
        levels.append(nodes := nodes[np.argsort(nodes)])
        first = child[nodes[child[nodes] > 0]].astype(np.int64)
        nodes = np.concatenate((first, first + 1))
    for nodes in reversed(levels):
        inner = nodes[child[nodes] > 0]
        held[inner] = held[child[inner]] + held[child[inner] + 1]
    return _cells(boxes, level, held, child == 0, level >= 0)


@drawn_cells.register
def _bvh(accel: Bvh) -> Cells:
    child = np.where(accel.count == 0, accel.child, 0)
    return _binary(accel.bounds, child, accel.count)


@drawn_cells.register
def _box_tree(accel: BoxTree) -> Cells:
    return _binary(accel.boxes, accel.child, accel.end - accel.first)


@drawn_cells.register
def _cell_tree(accel: CellTree) -> Cells:
    return _binary(cells_of(accel)[0], accel.child, accel.end - accel.first)


def as_octree(cells: Cells) -> Cells:
    """Return the cells of a binary tree whose every third level is one of the octree."""
    whole = (cells.level % 3 == 0) | cells.leaf
    return cells._replace(level=-(-cells.level // 3), shown=cells.shown & whole)


@drawn_cells.register
def _wide(accel: WideBvh) -> Cells:
    """Return the boxes: number 0 is the root, 1 + 8 node + k is child k of a node."""
    nodes = len(accel.octets) // WIDE_BYTES
    words = accel.floats.reshape(nodes, WIDE_WORDS)
    child = accel.integers.reshape(nodes, WIDE_WORDS)[:, CHILD : CHILD + WIDTH]
    octets = accel.octets.reshape(nodes, WIDE_BYTES)[:, BOX_BYTES:]
    octets = octets.reshape(nodes, 3, AXIS_BYTES)[:, :, : 2 * WIDTH].astype(np.float64)
    planes = octets * words[:, SCALE : SCALE + 3, None]
    planes += words[:, ORIGIN : ORIGIN + 3, None]
    planes = planes.reshape(nodes, 3, 2, WIDTH)  # axis, lower or upper, child
    boxes = planes.transpose(0, 3, 2, 1).reshape(-1, 6)
    level, held = np.zeros(nodes, np.int64), np.zeros((nodes, WIDTH), np.int64)
    for node in range(nodes):  # a node comes before those in it
        level[child[node][child[node] > 0]] = level[node] + 1
    in_block = (accel.blocks.id.reshape(-1, WIDTH) >= 0).sum(axis=1)
    for node in reversed(range(nodes)):
        for k, place in enumerate(child[node]):
            below = held[place].sum() if place > 0 else in_block[~place]
            held[node, k] = below if place else 0
    used = child.ravel() != 0
    whole = [*boxes[used, :3].min(axis=0), *boxes[used, 3:].max(axis=0)]
    return _cells(
        np.vstack((whole, boxes)),
        [0, *np.repeat(level + 1, WIDTH)],
        [held[0].sum(), *held.ravel()],
        [False, *(child.ravel() < 0)],
        [True, *used],
    )


@drawn_cells.register
def _grids(accel: Grids) -> Cells:
    """Return the grids, then all their cells."""
    n, level = accel.primitives.count, np.zeros(len(accel.first), np.int64)
    counts = np.diff(accel.start)
    cell_of = np.repeat(np.arange(len(counts)), counts)
    inner = accel.items >= n
    holder = np.zeros(len(level), np.int64)
    holder[accel.items[inner] - n] = cell_of[inner]
    grid_of = np.searchsorted(accel.first, np.arange(len(counts)), side="right") - 1
    for _ in range(len(level)):
        found = level[grid_of[holder]] + 1
        found[0] = 0
        if np.array_equal(found, level):
            break
        level = found
    high = accel.lower + accel.size * accel.resolution
    boxes = [np.hstack((accel.lower, high))]
    for g, (low, size) in enumerate(zip(accel.lower, accel.size, strict=True)):
        x, y, z = (np.arange(k) for k in accel.resolution[g])
        place = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
        boxes.append(np.hstack((low + place * size, low + (place + 1) * size)))
    divided = np.bincount(cell_of[inner], minlength=len(counts)) > 0
    cells_in = [counts[grid_of == g].sum() for g in range(len(level))]
    return _cells(
        np.vstack(boxes),
        [*level, *(level[grid_of] + 1)],
        [*cells_in, *counts],
        [*[False] * len(level), *~divided],
        [*[True] * len(level), *(counts > 0)],
    )


# --------------------------------------------------------------------------------- edges


def box_edges(box: Any) -> Edges:
    """Return the twelve edges of a box (6,)."""
    low, high = np.split(np.asarray(box, np.float64), 2)
    corners = low + CORNERS * (high - low)
    apart = np.abs(CORNERS[:, None] - CORNERS).sum(axis=2) == 1
    return corners[np.argwhere(np.triu(apart))]


def edges_between(normals: Any, offsets: Any) -> tuple[Edges, NDArray[np.bool_]]:
    """Return the edges of { x : normals x <= offsets }, and which planes have some.

    An edge is what all other planes leave of the line in which two planes meet.
    """
    normals, offsets = np.asarray(normals, np.float64), np.asarray(offsets, np.float64)
    first, second = np.triu_indices(len(normals), 1)
    n, m = normals[first], normals[second]
    along = np.cross(n, m)
    size = np.linalg.norm(along, axis=1)
    meet = size > 1e-9
    first, second, n, m = first[meet], second[meet], n[meet], m[meet]
    along, size = along[meet], size[meet, None]
    a, b = offsets[first, None], offsets[second, None]
    point = (a * np.cross(m, along) + b * np.cross(along, n)) / size**2
    along /= size
    speed, room = along @ normals.T, offsets - point @ normals.T
    rows = np.arange(len(first))
    speed[rows, first] = speed[rows, second] = 0.0
    room[rows, first] = room[rows, second] = 0.0
    level = np.abs(speed) < 1e-9
    with np.errstate(divide="ignore", invalid="ignore"):
        t = room / speed
    low = np.where(~level & (speed < 0.0), t, -np.inf).max(axis=1)
    high = np.where(~level & (speed > 0.0), t, np.inf).min(axis=1)
    tiny = 1e-6 * (1.0 + np.abs(offsets).max())
    kept = (high - low > tiny) & ~(level & (room < -tiny)).any(axis=1)
    ends = [point + s[:, None] * along for s in (low, high)]
    used = np.isin(np.arange(len(normals)), (first[kept], second[kept]))
    return np.stack(ends, axis=1)[kept], used


def edges_of_cells(tree: CellTree, wanted: Iterable[int]) -> dict[int, Edges]:
    """Return the edges of the cells of some nodes of a tree with oblique planes."""
    parent = np.full(len(tree.child), -1)
    inner = np.flatnonzero(tree.child)
    for side in (0, 1):
        parent[tree.child[inner] + side] = inner
    needed, found = set(), {}
    for node in wanted:
        while node >= 0 and node not in needed:
            needed.add(node)
            node = int(parent[node])
    box = tree.bounds.astype(np.float64)
    walls = np.vstack((np.eye(3), -np.eye(3))), np.concatenate((box[3:], -box[:3]))
    stack = [(0, *walls)]
    while stack:
        node, normals, offsets = stack.pop()
        found[node], used = edges_between(normals, offsets)
        child = int(tree.child[node])
        normals, offsets = normals[used], offsets[used]  # others cut nothing in it either
        plane = tree.plane[node].astype(np.float64)
        for side, sign in ((0, 1.0), (1, -1.0)):
            if child and child + side in needed:
                cut = np.append(offsets, sign * plane[3])
                stack.append((child + side, np.vstack((normals, sign * plane[:3])), cut))
    return found


def volume_edges(volume: Any) -> Edges:
    """Return the edges of a bounding volume; of a sphere three circles."""
    if isinstance(volume, Aabb):
        return box_edges(np.concatenate(volume))
    if isinstance(volume, Slabs):
        normals = volume.normal.T.astype(np.float64)
        planes = np.vstack((normals, -normals))
        return edges_between(planes, np.concatenate((volume.upper, -volume.lower)))[0]
    assert isinstance(volume, BoundingSphere)
    angle = 2.0 * np.pi * np.arange(CIRCLE + 1) / CIRCLE
    zero = np.zeros_like(angle)
    circle = np.stack((np.cos(angle), np.sin(angle), zero), axis=1)
    rings = [np.roll(circle, k, axis=1) for k in range(3)]
    points = volume.center[:, 0] + volume.radius[0] * np.array(rings)
    return np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 3)
