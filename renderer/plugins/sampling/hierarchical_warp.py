"""Hierarchical sample warping: from the unit square to a piecewise bilinear density.

A pyramid of sums is descended from the top. In each block of 2 x 2 a row is sampled by its
sum, then one of its columns, and both numbers are rescaled for the level below
[Clarberg2005]. Inside the final patch the marginal and the conditional density are linear
and are inverted directly. The map is continuous, so stratification is preserved. Mitsuba's
envmap uses the same method in the same order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel, table_columns
from renderer.kernels.lanes.functions import (
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_columns, gather_row

# a linear density whose ends differ relatively by less than this is taken as constant
FLAT = np.float32(1e-4)


@table_columns("blocks")
class Warp(NamedTuple):
    """A density over the unit square: `columns` x `rows` bilinear patches with mean 1."""

    columns: int
    rows: int
    nodes: NDArray[np.float32]  # ((columns + 1) (rows + 1),) density at the corners, by row
    # (4, blocks) sums over the four parts of each block: 00, 10, 01, 11 (x first)
    blocks: NDArray[np.float32]
    start: NDArray[np.int32]  # (levels,) first block, from the top down
    across: NDArray[np.int32]  # (levels,) blocks in a row


def make_warp(nodes: NDArray[np.float32]) -> Warp | None:
    """Return the warp for a density that is given at the corners of the patches.

    Parameters
    ----------
    nodes : ndarray of shape (rows + 1, columns + 1)
        Not negative, of any scale; at least two rows and columns.

    Returns
    -------
    Warp or None
        None if the density is 0 everywhere, or cannot be scaled to the mean 1 in float32.
    """
    corners = nodes[:-1, :-1] + nodes[:-1, 1:] + nodes[1:, :-1] + nodes[1:, 1:]
    patches = np.float32(0.25) * corners
    total = patches.sum(dtype=np.float64)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        scale = np.float32(patches.size / total)
        nodes, level = nodes * scale, patches * scale
    if not (total > 0.0 and np.isfinite(nodes).all() and level.any()):
        return None
    rows, columns = patches.shape
    levels = pyramid(level) or [np.zeros((4, 0, 0), np.float32)]
    counts = [part.shape[1] * part.shape[2] for part in levels]
    return Warp(
        columns,
        rows,
        np.ascontiguousarray(nodes.ravel(), np.float32),
        by_columns(np.concatenate([p.reshape(4, -1) for p in levels], axis=1)),
        np.cumsum([0, *counts[:-1]]).astype(np.int32),
        np.array([part.shape[2] for part in levels], np.int32),
    )


def pyramid(level: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Return the levels (4, ..., rows, columns) of blocks for sums (..., rows, columns).

    The top level is first; the first axis is that of `Warp.blocks`.
    """
    levels: list[NDArray[np.float32]] = []
    whole = [(0, 0)] * (level.ndim - 2)
    while level.shape[-2:] != (1, 1):
        level = np.pad(level, [*whole, *((0, n % 2) for n in level.shape[-2:])])
        parts = [level[..., j::2, i::2] for j in (0, 1) for i in (0, 1)]
        levels.insert(0, np.stack(parts))
        level = parts[0] + parts[1] + parts[2] + parts[3]
    return levels


@kernel
def _clip(x):
    return minimum(maximum(x, splat_f32(0.0)), splat_f32(1.0))


@kernel
def _between(a, b, t):
    return b * t + (a - a * t)


@kernel
def _linear(a, b, x):
    """Return x in [0, 1] with the fraction x of the area below a line from a to b."""
    steep = fabs(a - b) > FLAT * (a + b)
    slope = select(steep, a - b, splat_f32(1.0))
    below = sqrt(maximum(_between(a * a, b * b, x), splat_f32(0.0)))
    return select(steep, (a - below) / slope, x)


@kernel
def corners(warp, column, row, mask):
    """Return the density at the corners 00, 10, 01, 11 of patches."""
    first = row * np.int32(warp.columns + 1) + column
    above = first + np.int32(warp.columns + 1)
    return (
        gather_row(warp.nodes, 0, first, mask),
        gather_row(warp.nodes, 0, first + 1, mask),
        gather_row(warp.nodes, 0, above, mask),
        gather_row(warp.nodes, 0, above + 1, mask),
    )


@kernel
def descend(blocks, block, column, row, x, y, mask):
    """Sample one part of each block by numbers in [0, 1), in proportion to its sum.

    Returns
    -------
    column, row, x, y
        On the next level. The numbers are rescaled and uniform in [0, 1) again.
    """
    v00, v10, v01, v11 = gather_columns(blocks, 0, block, mask)
    lower, upper = v00 + v10, v01 + v11
    y = _clip(y) * (lower + upper)
    second = y > lower
    y = select(second, y - lower, y)
    share = select(second, upper, lower)
    left, right = select(second, v01, v00), select(second, v11, v10)
    row = row + row + select(second, splat_i32(1), splat_i32(0))
    x = _clip(x) * share
    second = x > left
    x = select(second, x - left, x)
    part = select(second, right, left)
    column = column + column + select(second, splat_i32(1), splat_i32(0))
    # one division for both numbers
    inverse = 1.0 / (share * part)
    return column, row, x * (share * inverse), y * (part * inverse)


@kernel
def choose_patch(warp, x, y, mask):
    """Sample patches in proportion to their sums, as `descend`."""
    return choose_patch_below(warp, 0, splat_i32(0), splat_i32(0), x, y, mask)


@kernel
def choose_patch_below(warp, level, column, row, x, y, mask):
    """Sample patches inside of the given blocks of a level."""
    for k in range(level, warp.start.size):
        block = row * warp.across[k] + (column + warp.start[k])
        column, row, x, y = descend(warp.blocks, block, column, row, x, y, mask)
    return column, row, x, y


@kernel
def sample_warp(warp, x, y, mask):
    """Map numbers in [0, 1) to points (u, v) of the unit square, with their pdf."""
    column, row, x, y = choose_patch(warp, x, y, mask)
    return place_in_patch(warp, column, row, x, y, mask)


@kernel
def place_in_patch(warp, column, row, x, y, mask):
    """Map numbers in [0, 1) to points of patches.

    Returns
    -------
    u, v, density
        The density is NaN or 0 in the rare case that a number falls exactly on the edge
        of a part with probability 0.
    """
    v00, v10, v01, v11 = corners(warp, column, row, mask)
    y = _linear(v00 + v10, v01 + v11, y)
    left, right = _between(v00, v01, y), _between(v10, v11, y)
    x = _linear(left, right, x)
    u = (to_f32(column) + x) * np.float32(1.0 / warp.columns)
    v = (to_f32(row) + y) * np.float32(1.0 / warp.rows)
    return u, v, _between(left, right, x)


@kernel
def patch_at(warp, u, v):
    """Return column and row of the patches at points of [0, 1]^2, and offsets in them."""
    x, y = _clip(u) * np.float32(warp.columns), _clip(v) * np.float32(warp.rows)
    column = minimum(to_i32(x), splat_i32(np.int32(warp.columns - 1)))
    row = minimum(to_i32(y), splat_i32(np.int32(warp.rows - 1)))
    return column, row, x - to_f32(column), y - to_f32(row)


@kernel
def warp_density(warp, u, v, mask):
    """Return the pdf of `sample_warp` at points of [0, 1]^2."""
    column, row, x, y = patch_at(warp, u, v)
    v00, v10, v01, v11 = corners(warp, column, row, mask)
    return _between(_between(v00, v10, x), _between(v01, v11, x), y)
