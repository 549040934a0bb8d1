"""Primitives in blocks of eight: a leaf of the 8-wide BVH tests one block at once.

The numbers of a block are contiguous in memory. For triangles, the numbers that each ray
reads are 384 bytes (six cache lines); the rows of a `Group` would touch one cache line
each. Primitive k of a group is lane k % 8 of block k // 8. Empty lanes of a block are
NaN, which no ray hits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.fields import (
    bounds_of,
    lanes_from_block,
    one_from_block,
    size_in_block,
)
from renderer.plugins.shapes.primitives import float32, primitive_at

WIDTH = 8
AT_FIRST = 12 * WIDTH  # upper bound of the numbers of a block that each ray reads


class Blocks(NamedTuple):
    """Primitives of a group in blocks of eight, without their `Derived` fields."""

    form: Any  # record whose type selects the class of the primitives
    rows: NDArray[np.float32]  # (blocks, numbers of a primitive * 8)
    bounds: NDArray[np.float32]  # (blocks, bounds of a primitive) maximum of eight lanes
    id: NDArray[np.int32]  # (blocks * 8,) primitive id in the scene, -1 in the padding
    count: int  # blocks * 8


@interface
def primitives_in(blocks: Any, block: int) -> Any:
    """Return the eight primitives of a block in lanes."""


@primitive_at.by(Blocks)
@kernel
def _one_of_block(blocks, k):
    return one_from_block(blocks.form, blocks.rows, blocks.bounds, k >> 3, k & 7)


@primitives_in.by(Blocks)
@kernel
def _lanes_of_block(blocks, block):
    return lanes_from_block(blocks.form, blocks.rows, blocks.bounds, block, 0)


def aligned_bytes(count: int) -> NDArray[np.uint8]:
    """Return `count` zero bytes whose address is a multiple of 128 (two cache lines)."""
    memory = np.zeros(count + 128, np.uint8)
    skip = -memory.ctypes.data % 128
    return memory[skip : skip + count]


def blocks_of(group: Callable[[NDArray[np.int64]], Any], columns: NDArray[np.int64]) -> Any:
    """Return primitives as `Blocks`.

    Parameters
    ----------
    group
        Builds a `Group` from column numbers.
    columns
        (blocks * 8,) column for each lane of the blocks; -1 for an empty lane.
    """
    form, rows, ids, count = group(np.maximum(columns, 0))
    eights = rows[:, :count].reshape(len(rows), -1, WIDTH).swapaxes(0, 1)
    empty = columns.reshape(-1, 1, WIDTH) < 0
    numbers = size_in_block(type(form))
    shape = (len(eights), numbers, WIDTH)
    blocks = aligned_bytes(4 * math.prod(shape)).view(np.float32).reshape(shape)
    blocks[...] = eights[:, :numbers]
    np.copyto(blocks, np.nan, where=empty)  # zeros would be a sphere at the origin
    bounds = eights[:, len(rows) - bounds_of(type(form)) :]
    largest = float32(np.max(bounds, axis=2, initial=0.0, where=~empty))
    ids = np.where(columns < 0, np.int32(-1), ids[:count])
    return Blocks(form, blocks.reshape(len(blocks), -1), largest, ids, count)
