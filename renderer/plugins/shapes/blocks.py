"""Primitives in blocks of eight: what a leaf of the wide tree tests at once.

A block's numbers lie side by side (384 bytes for triangles, six cache lines), where the
rows of a group would touch a line for each of its twelve rows. Primitive k of a group is
lane k % 8 of block k // 8; a block that is not full ends with NaN, which no ray hits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.memory import load_eight, load_one
from renderer.kernels.lanes.vectors import vec3

WIDTH = 8


BLOCKS_OF: dict[type, type] = {}  # record of a group -> record of its blocks


@interface
def primitives_in(blocks: Any, block: int) -> Any:
    """Return the eight primitives of a block as lanes."""


def aligned_bytes(count: int) -> NDArray[np.uint8]:
    """Return `count` zeros that begin with a pair of cache lines."""
    memory = np.zeros(count + 128, np.uint8)
    skip = -memory.ctypes.data % 128
    return memory[skip : skip + count]


def blocks_of(group: Callable[[NDArray[np.int64]], Any], columns: NDArray[np.int64]) -> Any:
    """Return primitives in blocks.

    Parameters
    ----------
    group
        Makes a group of columns.
    columns
        (blocks * 8,) the column of each place; -1 leaves it empty.
    """
    record = group(np.maximum(columns, 0))
    *fields, ids, count = (
        field
        for name, field in zip(record._fields, record, strict=True)
        if name != "breadth"
    )
    rows = np.concatenate([np.atleast_2d(field)[:, :count] for field in fields])
    rows[:, columns < 0] = np.nan  # zeros would be a sphere at the origin
    eights = rows.reshape(len(rows), -1, WIDTH).swapaxes(0, 1)
    blocks = aligned_bytes(4 * eights.size).view(np.float32).reshape(eights.shape)
    blocks[...] = eights
    return BLOCKS_OF[type(record)](
        blocks.reshape(len(blocks), -1),
        np.where(columns < 0, np.int32(-1), ids[:count]),
        count,
    )


@kernel
def three_in(rows, block, row):
    """Return a vector of the eight primitives of a block as lanes, from three rows."""
    return vec3(
        load_eight(rows, block, 8 * row),
        load_eight(rows, block, 8 * row + 8),
        load_eight(rows, block, 8 * row + 16),
    )


@kernel
def column_in(rows, block, row, j):
    """Return a vector of primitive j of a block as scalars, from three rows."""
    place = 8 * row + j
    return vec3(
        load_one(rows, block, place),
        load_one(rows, block, place + 8),
        load_one(rows, block, place + 16),
    )
