"""Validation of every structure: no ray can miss a primitive.

All primitives are inserted into the structure: each cell that a primitive reaches into must
list it. A primitive is represented by its box and its hull, grown by the amount that the
traversal needs, which is less than the builders' growth. No code is shared with the
builders.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.extents import Extents
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import MAX_DEPTH, PROVEN, CellTree
from renderer.textbook.grid_walk import LEVELS, Grids

Columns = NDArray[np.int64]
_CHUNK = 100_000  # pairs of a primitive and a plane per batch
# By rounding, a ray can be outside of its grid cell by this much, in `pad` (32 units
# in the last place of `reach`; a plane's distance takes 4 operations).
_ASTRAY = 0.25


def validate_structure(structure: Any, extents: Extents) -> None:
    """Check a `CellTree`, `BoxTree` or `Grids`, and that rays find each of n primitives.

    Raises
    ------
    ValueError
        Otherwise; the message says which node, cell or item, and what is wrong with it.
    """
    n = extents.lower.shape[1]
    _require(structure.primitives.count == n, f"not each of {n} primitives is held once")
    _require(structure.reach <= np.float32(extents.reach), "the reach is beyond the pads'")
    if isinstance(structure, CellTree):
        _require_nodes(structure, n)
        _require_planes(structure)
        _require_held_by_leaves(structure, extents)
    elif isinstance(structure, BoxTree):
        _require_nodes(structure, n)
        _require_held_by_boxes(structure, extents)
    else:
        _require_cells(structure, n)
        _require_held_by_cells(structure, extents)


def _require(condition: Any, fault: str) -> None:
    if not condition:
        raise ValueError(fault)


def _require_none(what: str, numbers: NDArray[Any], fault: str) -> None:
    """Raise ValueError for the first of the given numbers, if any, with its fault."""
    if numbers.size:
        raise ValueError(f"{what} {numbers[0]} (of {numbers.size} such) {fault}")


def _is_listed(key: Columns, listed: Columns) -> NDArray[np.bool_]:
    """Return which keys, all >= 0, are among the listed ones, which ascend."""
    return np.append(listed, -1)[np.searchsorted(listed, key)] == key


# -------------------------------------------------------------------------------- trees


def _require_nodes(tree: Any, n: int) -> None:
    """Check each node and each leaf by itself."""
    nodes = len(tree.child)
    lengths = {len(rows) for rows in (tree[0], tree.first, tree.end)}
    _require(lengths == {nodes}, "the arrays of nodes differ in length")
    inner, leaves = np.flatnonzero(tree.child), np.flatnonzero(tree.child == 0)
    behind = tree.child[inner].astype(np.int64)
    _require_none("node", inner[behind <= inner], "comes after its children")
    _require_none("node", inner[behind + 1 >= nodes], "has children that do not exist")
    parents = np.bincount(np.concatenate((behind, behind + 1)), minlength=nodes)
    wrong = np.flatnonzero(parents[1:] != 1) + 1
    _require_none("node", wrong, "is not the child of exactly one node")
    first, end = tree.first[leaves], tree.end[leaves]
    outside = (first < 0) | (end < first) | (end > len(tree.items))
    _require_none("leaf", leaves[outside], "has items that do not exist")
    strange = np.flatnonzero((tree.items < 0) | (tree.items >= n))
    _require_none("item", strange, "is no primitive's column")


def _listed(tree: Any) -> tuple[Columns, Columns]:
    """Return the leaf and the primitive of each reference."""
    leaves = np.flatnonzero(tree.child == 0)
    counts = (tree.end - tree.first)[leaves]
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    items = tree.items[np.repeat(tree.first[leaves], counts) + place]
    return np.repeat(leaves, counts), items.astype(np.int64)


def _require_held_by_boxes(tree: BoxTree, extents: Extents) -> None:
    """Check that boxes enclose all below them, and that leaves hold each primitive."""
    pad, (leaf, k) = extents.pad, _listed(tree)
    lost = np.setdiff1d(np.arange(extents.lower.shape[1]), k)
    _require_none("primitive", lost, "is in no leaf")
    inside = (tree.boxes[leaf, :3] <= extents.lower.T[k] - pad).all(axis=1)
    inside &= (tree.boxes[leaf, 3:] >= extents.upper.T[k] + pad).all(axis=1)
    _require_none("leaf", leaf[~inside], "does not hold its primitives")
    inner = np.flatnonzero(tree.child)
    for child in (tree.child[inner], tree.child[inner] + 1):
        inside = (tree.boxes[inner, :3] <= tree.boxes[child, :3]).all(axis=1)
        inside &= (tree.boxes[inner, 3:] >= tree.boxes[child, 3:]).all(axis=1)
        _require_none("node", inner[~inside], "does not hold its children")
    level = np.zeros(1, np.int64)
    for _ in range(MAX_DEPTH + 1):
        level = tree.child[level[tree.child[level] > 0]].astype(np.int64)
        level = np.concatenate((level, level + 1))
    _require_none("node", level, f"is deeper than {MAX_DEPTH}")


def _require_planes(tree: CellTree) -> None:
    inner = np.flatnonzero(tree.child)
    length = np.linalg.norm(tree.plane[inner, :3].astype(np.float64), axis=1)
    _require_none("node", inner[~(np.abs(length - 1.0) < 1e-6)], "has no unit normal")
    # the bound on the rounding of distances depends on this
    far = ~(np.abs(tree.plane[inner, 3]) <= 1.001 * tree.reach)
    _require_none("node", inner[far], "has its plane out of reach")


def _require_held_by_leaves(tree: CellTree, extents: Extents) -> None:
    n, pad = extents.lower.shape[1], extents.pad
    inside = (tree.bounds[:3] <= extents.lower.T - pad).all(axis=1)
    inside &= (tree.bounds[3:] >= extents.upper.T + pad).all(axis=1)
    _require_none("primitive", np.flatnonzero(~inside), "is out of bounds")
    leaf, held = _listed(tree)
    listed = np.sort(leaf * n + held)
    node, k = np.zeros(n, np.int64), np.arange(n)
    for _ in range(MAX_DEPTH + 1):
        at_leaf = tree.child[node] == 0
        lost = np.flatnonzero(at_leaf)[~_is_listed(node[at_leaf] * n + k[at_leaf], listed)]
        if lost.size:
            raise ValueError(
                f"leaf {node[lost[0]]} does not list primitive {k[lost[0]]} "
                f"(of {lost.size} such), which reaches into it"
            )
        node, k = node[~at_leaf], k[~at_leaf]
        if node.size == 0:
            return
        low, high = _spans(extents, k, tree.plane[node])
        behind, in_front = low <= tree.plane[node, 3], high >= tree.plane[node, 3]
        child = tree.child[node].astype(np.int64)
        node = np.concatenate((child[behind], child[in_front] + 1))
        k = np.concatenate((k[behind], k[in_front]))
    raise ValueError(f"node {node[0]} is deeper than {MAX_DEPTH}")


def _spans(
    extents: Extents, columns: Columns, planes: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the range of normal . p over the points p of a primitive, for each pair."""
    found = np.empty((2, len(columns)))
    grown = PROVEN * extents.pad
    for at in range(0, len(columns), _CHUNK):
        part = slice(at, at + _CHUNK)
        k, normal = columns[part], planes[part, :3].T.astype(np.float64)
        low, high = extents.lower[:, k].astype(np.float64), extents.upper[:, k]
        middle = (normal * (low + high)).sum(axis=0) / 2
        half = (np.abs(normal) * (high - low)).sum(axis=0) / 2 + grown
        along = np.einsum("ak,apk->pk", normal, extents.points[:, :, k])
        growth = extents.radius[k] + grown
        found[0, part] = np.maximum(middle - half, along.min(axis=0) - growth)
        found[1, part] = np.minimum(middle + half, along.max(axis=0) + growth)
    return found[0], found[1]


# -------------------------------------------------------------------------------- grids


class _Parts(NamedTuple):
    """Parts of primitives that rays must find, each in one grid."""

    grid: Columns  # (k,)
    primitive: Columns  # (k,)
    low: NDArray[np.float64]  # (3, k) lower corner of its box
    high: NDArray[np.float64]  # (3, k) upper corner


def _require_cells(grids: Grids, n: int) -> None:
    """Check that grids nest, and that cells and items are in sequence without gaps."""
    wrong = ~((grids.size > 0) & np.isfinite(grids.size)).all(axis=1)
    wrong |= (grids.resolution < 1).any(axis=1) | ~np.isfinite(grids.lower).all(axis=1)
    _require_none("grid", np.flatnonzero(wrong), "has no cells")
    counts = grids.resolution.astype(np.int64).prod(axis=1)
    ends = np.cumsum(counts)
    wrong = grids.first != ends - counts
    _require_none("grid", np.flatnonzero(wrong), "does not begin where the last ends")
    _require(len(grids.start) == ends[-1] + 1, "the starts are not one more than the cells")
    begins = grids.start.astype(np.int64)
    wrong = np.diff(begins, prepend=0) < 0
    _require_none("cell", np.flatnonzero(wrong), "starts before the last one")
    _require(begins[0] == 0 and begins[-1] == len(grids.items), "cells hold other items")
    items, holder = grids.items.astype(np.int64), _holders(grids)
    wrong = (items < 0) | (items >= n + len(grids.first))
    _require_none("item", np.flatnonzero(wrong), "is neither a primitive nor a grid")
    wrong = (items >= n) & (items - n <= holder)
    _require_none("item", np.flatnonzero(wrong), "is a grid around its own")
    cell = np.repeat(np.arange(len(begins) - 1), np.diff(begins))
    wrong = (np.diff(cell, prepend=-1) == 0) & (np.diff(items, prepend=-1) <= 0)
    _require_none("item", np.flatnonzero(wrong), "is not after the one before in its cell")
    outer = _outer_grids(grids, n)
    inner = items >= n
    wrong = np.unique(items[inner][outer[items[inner] - n] != holder[inner]] - n)
    _require_none("grid", wrong, "lies in two others")
    _require_none("grid", np.flatnonzero(outer[1:] < 0) + 1, "lies in no other")
    level = outer
    for _ in range(LEVELS - 1):
        level = np.where(level >= 0, outer[level], -1)
    _require_none("grid", np.flatnonzero(level >= 0), "lies in too many others")


def _holders(grids: Grids) -> Columns:
    """Return the grid that holds each item."""
    counts = np.diff(np.append(grids.start[grids.first], len(grids.items)))
    return np.repeat(np.arange(len(grids.first)), counts)


def _outer_grids(grids: Grids, n: int) -> Columns:
    """Return the grid around each grid, -1: none."""
    outer, inner = np.full(len(grids.first), -1), grids.items >= n
    outer[grids.items[inner] - n] = _holders(grids)[inner]
    return outer


def _leads(grids: Grids, n: int) -> Columns:
    """Return all pairs (grid, primitive below it) as grid * n + primitive, ascending."""
    outer, held = _outer_grids(grids, n), grids.items < n
    grid, primitive = _holders(grids)[held], grids.items[held].astype(np.int64)
    pairs = []
    while grid.size:
        pairs.append(np.unique(grid * n + primitive))
        grid, primitive = outer[pairs[-1] // n], pairs[-1] % n
        grid, primitive = grid[grid >= 0], primitive[grid >= 0]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *pairs]))


def _require_held_by_cells(grids: Grids, extents: Extents) -> None:
    """Check that each cell lists the primitives in it, or a finer grid that holds them."""
    n, pad = extents.lower.shape[1], extents.pad
    total, leads = n + len(grids.first), _leads(grids, n)
    cell_of = np.repeat(np.arange(len(grids.start) - 1), np.diff(grids.start))
    listed = cell_of * total + grids.items
    inner = grids.items >= n
    cells_of_grids, held_grids = cell_of[inner], grids.items[inner].astype(np.int64) - n
    low, high = extents.lower.astype(np.float64), extents.upper.astype(np.float64)
    parts = _Parts(np.zeros(n, np.int64), np.arange(n), low - pad, high + pad)
    while parts.grid.size:
        k, cell, low, high = _cells_met(grids, parts, _ASTRAY * pad)
        missing = ~_is_listed(cell * total + parts.primitive[k], listed)
        k, cell, low, high = (rows[..., missing] for rows in (k, cell, low, high))
        # the grids in each such cell that contain the primitive
        begin, end = (
            np.searchsorted(cells_of_grids, cell, side) for side in ("left", "right")
        )
        pair = np.repeat(np.arange(len(k)), end - begin)
        finer = held_grids[np.arange(len(pair)) + (end - np.cumsum(end - begin))[pair]]
        leading = _is_listed(finer * n + parts.primitive[k[pair]], leads)
        pair, finer = pair[leading], finer[leading]
        lost = np.setdiff1d(np.arange(len(k)), pair)
        if lost.size:
            grid, primitive = parts.grid[k[lost[0]]], parts.primitive[k[lost[0]]]
            raise ValueError(
                f"cell {cell[lost[0]]} of grid {grid} does not list primitive {primitive} "
                f"(of {lost.size} such), which reaches into it"
            )
        low = np.maximum(parts.low[:, k], low)[:, pair]
        high = np.minimum(parts.high[:, k], high)[:, pair]
        parts = _Parts(finer, parts.primitive[k[pair]], low, high)


def _cells_met(grids: Grids, parts: _Parts, margin: float) -> Any:
    """Return pairs of a part and a cell that it reaches into, with the cells' boxes."""
    lower = grids.lower[parts.grid].T.astype(np.float64)
    size = grids.size[parts.grid].T.astype(np.float64)
    cells = grids.resolution[parts.grid].T.astype(np.int64)
    outside = (parts.low < lower) | (parts.high > lower + size * cells)
    _require_none(
        "grid", parts.grid[outside.any(axis=0)], "does not enclose what it leads to"
    )
    first = np.clip(np.floor((parts.low - margin - lower) / size), 0, cells - 1)
    last = np.clip(np.floor((parts.high + margin - lower) / size), 0, cells - 1)
    first, spans = first.astype(np.int64), (last - first + 1).astype(np.int64)
    counts = spans.prod(axis=0)
    k = np.repeat(np.arange(len(counts)), counts)
    rest = np.arange(len(k)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = np.empty((3, len(k)), np.int64)
    for axis in range(3):
        rest, place = np.divmod(rest, spans[axis, k])
        along[axis] = first[axis, k] + place
    cell = grids.first[parts.grid[k]] + along[0]
    cell += cells[0, k] * (along[1] + cells[1, k] * along[2])
    low = lower[:, k] + along * size[:, k] - margin
    return k, cell, low, low + size[:, k] + 2 * margin
