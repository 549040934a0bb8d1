"""What must hold of any grid or hierarchy of grids, proved without the builders' code.

Wherever a ray may find a primitive, and whichever cell that is in, the cell must hold the
primitive, or a grid that passes the same test for that part of space.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.grids.grid_cells import Grids
from renderer.accelerators.grids.grid_walk import LEVELS
from renderer.accelerators.octree_and_bsp.cell_checks import in_sorted
from renderer.plugins.shapes.extents import Extents

# Rays that are in a cell may be so far outside of it by their rounding, in `pad` (which is
# 32 units in the last place of `reach`; a plane's distance takes 4 operations).
_ASTRAY = 0.25


class _Parts(NamedTuple):
    """Parts of primitives that must be found, each through one grid."""

    grid: NDArray[np.int64]  # (k,)
    primitive: NDArray[np.int64]  # (k,)
    low: NDArray[np.float64]  # (3, k) where it may be
    high: NDArray[np.float64]  # (3, k)


def validate_grids(grids: Grids, extents: Extents) -> None:
    """Check that a ray finds each of n primitives wherever it may be.

    Raises
    ------
    ValueError
        If not; the message says which grid, cell and item, and what is wrong.
    """
    n = extents.lower.shape[1]
    _require_rows(grids)
    owner = np.repeat(np.arange(len(grids.first)), _cell_counts(grids))
    cell = np.repeat(np.arange(len(owner)), np.diff(grids.start))
    _require_items(grids, cell, owner, n)
    parent = _parents(grids, owner[cell], n)
    reachable = _reachable(grids, owner[cell], parent, n)
    low, high = extents.lower.astype(np.float64), extents.upper.astype(np.float64)
    pad = extents.pad
    parts = _Parts(np.zeros(n, np.int64), np.arange(n), low - pad, high + pad)
    while parts.grid.size:
        parts = _require_found(grids, parts, extents, cell, reachable)


def _require_none(wrong: NDArray[np.bool_], fault: str) -> None:
    """Raise a ValueError that names the first wrong one at the {} of `fault`."""
    if wrong.any():
        raise ValueError(fault.format(wrong.argmax()))


def _cell_counts(grids: Grids) -> NDArray[np.int64]:
    return grids.resolution.astype(np.int64).prod(axis=1)


# ------------------------------------------------------------------------------ the arrays


def _require_rows(grids: Grids) -> None:
    """Check that cells and items follow each other without gaps."""
    wrong = ~((grids.size > 0) & np.isfinite(grids.size)).all(axis=1)
    wrong |= (grids.resolution < 1).any(axis=1) | ~np.isfinite(grids.lower).all(axis=1)
    _require_none(wrong, "grid {} has no cells")
    ends = np.cumsum(_cell_counts(grids))
    _require_none(
        grids.first != np.append(0, ends[:-1]), "grid {} does not begin where the last ends"
    )
    if len(grids.start) != ends[-1] + 1:
        raise ValueError(f"there are {ends[-1]} cells and {len(grids.start)} starts")
    begins = grids.start.astype(np.int64)
    _require_none(np.diff(begins, prepend=0) < 0, "cell {} starts before the last one")
    if begins[0] != 0 or begins[-1] != len(grids.items):
        raise ValueError(
            f"cells hold items {begins[0]} to {begins[-1]} of {len(grids.items)}"
        )


def _require_items(
    grids: Grids, cell: NDArray[np.int64], owner: NDArray[np.int64], n: int
) -> None:
    """Check that items are primitives or grids of higher number, ascending in a cell."""
    items = grids.items.astype(np.int64)
    wrong = (items < 0) | (items >= n + len(grids.first))
    _require_none(wrong, "item {} is neither a primitive nor a grid")
    wrong = (items >= n) & (items - n <= owner[cell])
    _require_none(wrong, "item {} is a grid around its own")
    wrong = (np.diff(cell, prepend=-1) == 0) & (np.diff(items, prepend=-1) <= 0)
    _require_none(wrong, "item {} is not after the one before it in its cell")


def _parents(grids: Grids, holder: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Check that grids nest, and not too deep; return the grid around each, -1: none."""
    inner = grids.items >= n
    child, parent = grids.items[inner] - n, holder[inner]
    outer = np.full(len(grids.first), -1)
    outer[child] = parent
    torn = np.zeros(len(outer), bool)
    torn[child[outer[child] != parent]] = True
    _require_none(torn, "grid {} lies in two others")
    alone = outer < 0
    alone[0] = False
    _require_none(alone, "grid {} lies in no other")
    level = outer
    for _ in range(LEVELS - 1):
        level = np.where(level >= 0, outer[level], -1)
    _require_none(level >= 0, f"grid {{}} lies in more than {LEVELS - 1} others")
    return outer


def _reachable(
    grids: Grids, holder: NDArray[np.int64], parent: NDArray[np.int64], n: int
) -> NDArray[np.int64]:
    """Return all pairs (grid, primitive it leads to) as grid * n + primitive."""
    held = grids.items < n
    grid, primitive = holder[held], grids.items[held].astype(np.int64)
    pairs = [grid * n + primitive]
    while grid.size:
        grid = parent[grid]
        grid, primitive = grid[grid >= 0], primitive[grid >= 0]
        pairs.append(grid * n + primitive)
    return np.unique(np.concatenate(pairs))


# ------------------------------------------------------------------------------- the cells


def _require_found(
    grids: Grids,
    parts: _Parts,
    extents: Extents,
    holder: NDArray[np.int64],
    reachable: NDArray[np.int64],
) -> _Parts:
    """Check that cells hold what meets them; return what they leave to finer grids.

    `holder` is the cell of each item.
    """
    n = extents.lower.shape[1]
    total = n + len(grids.first)
    _require_inside(grids, parts)
    k, cell, low, high = _cells_met(grids, parts, _ASTRAY * extents.pad)
    met = _plane_meets(parts.primitive[k], low, high, extents)
    primitive = parts.primitive[k]
    met &= ~in_sorted(cell * total + primitive, holder * total + grids.items)
    k, cell, primitive, low, high = (a[..., met] for a in (k, cell, primitive, low, high))

    finer, inside = _finer_grid(grids, cell, primitive, reachable, n)
    if not inside.all():
        at = inside.argmin()
        raise ValueError(
            f"cell {cell[at]} of grid {parts.grid[k[at]]} lacks primitive "
            f"{primitive[at]}, which meets it"
        )
    low, high = np.maximum(parts.low[:, k], low), np.minimum(parts.high[:, k], high)
    return _Parts(finer, primitive, low, high)


def _require_inside(grids: Grids, parts: _Parts) -> None:
    """Check that the boxes of grids enclose what must be found in them."""
    low = grids.lower[parts.grid].T.astype(np.float64)
    size = grids.size[parts.grid].T.astype(np.float64)
    high = low + size * grids.resolution[parts.grid].T
    outside = ((parts.low < low) | (parts.high > high)).any(axis=0)
    if outside.any():
        k = outside.argmax()
        raise ValueError(
            f"grid {parts.grid[k]} does not enclose primitive {parts.primitive[k]}"
        )


def _cells_met(
    grids: Grids, parts: _Parts, margin: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return pairs of a part and a cell that its box meets, with the cells' boxes."""
    lower = grids.lower[parts.grid].T.astype(np.float64)
    size = grids.size[parts.grid].T.astype(np.float64)
    cells = grids.resolution[parts.grid].T.astype(np.int64)
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


def _plane_meets(
    primitive: NDArray[np.int64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    extents: Extents,
) -> NDArray[np.bool_]:
    """Return whether the planes of flat primitives come within `pad` of boxes."""
    normal = extents.normal.astype(np.float64)
    heights = np.einsum("an,apn->pn", normal, extents.points.astype(np.float64))
    middle = (normal[:, primitive] * (low + high)).sum(axis=0) / 2
    half = (np.abs(normal[:, primitive]) * (high - low)).sum(axis=0) / 2
    half += extents.pad + extents.radius[primitive]
    below = middle + half < heights.min(axis=0)[primitive]
    above = middle - half > heights.max(axis=0)[primitive]
    flat = (normal != 0).any(axis=0)[primitive]
    return ~(flat & (below | above))


def _finer_grid(
    grids: Grids,
    cell: NDArray[np.int64],
    primitive: NDArray[np.int64],
    reachable: NDArray[np.int64],
    n: int,
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return for each cell the grid in it that leads to a primitive, and if there is any.

    A grid that leads to it nowhere may be right, too: box and plane both meet the cell, and
    apart from each other. So where none does, the cell's last one is returned.
    """
    finer = np.full(len(cell), -1)
    begin, end = grids.start[cell].astype(np.int64), grids.start[cell + 1]
    for back in range(1, int((end - begin).max(initial=0)) + 1):
        at = np.flatnonzero(end - back >= begin)
        at = at[grids.items[end[at] - back] >= n]
        if at.size == 0:
            break
        grid = grids.items[end[at] - back].astype(np.int64) - n
        leads = in_sorted(grid * n + primitive[at], reachable)
        finer[at] = np.where(leads | (finer[at] < 0), grid, finer[at])
    return finer, finer >= 0
