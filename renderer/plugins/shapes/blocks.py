"""Primitives in blocks of eight: what a leaf of the wide tree tests at once.

A block's numbers lie side by side (for triangles those that each ray reads are 384 bytes,
six cache lines), where the rows of a group would touch a line for each of its rows.
Primitive k of a group is lane k % 8 of block k // 8; a block that is not full ends with
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
AT_FIRST = 12 * WIDTH  # numbers of a block that each ray reads, at most


class Blocks(NamedTuple):
    """The primitives of a group in blocks, without the numbers that follow from others."""

    form: Any  # stands for the class of the primitives
    rows: NDArray[np.float32]  # (blocks, numbers of a primitive * 8)
    bounds: NDArray[np.float32]  # (blocks, bounds of a primitive) the largest of eight
    id: NDArray[np.int32]  # (blocks * 8,) primitive id in the scene, -1 in the padding
    count: int  # blocks * 8


@interface
def primitives_in(blocks: Any, block: int) -> Any:
    """Return the eight primitives of a block as lanes."""


@primitive_at.by(Blocks)
@kernel
def _one_of_block(blocks, k):
    return one_from_block(blocks.form, blocks.rows, blocks.bounds, k >> 3, k & 7)


@primitives_in.by(Blocks)
@kernel
def _lanes_of_block(blocks, block):
    return lanes_from_block(blocks.form, blocks.rows, blocks.bounds, block, 0)


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
