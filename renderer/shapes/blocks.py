"""Primitives in blocks of eight: what a leaf of the wide tree tests at once.

A block's numbers lie side by side (384 bytes for triangles, six cache lines), where the
rows of a group would touch a line for each of its twelve rows. Primitive k of a group is
lane k % 8 of block k // 8; a block that is not full ends with NaN, which no ray hits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.jit import kernel, record_class
from renderer.lanes.memory import load_eight, load_one
from renderer.shapes.cylinder import Cylinder, Cylinders
from renderer.shapes.disk import Disks
from renderer.shapes.patch import Patch
from renderer.shapes.rectangle import Rectangles
from renderer.shapes.sphere import Sphere, Spheres
from renderer.shapes.triangle import Triangles
from renderer.vectors import vec3

WIDTH = 8


class TriangleBlocks(NamedTuple):
    """Corner, edges and normal of eight triangles a block."""

    rows: NDArray[np.float32]  # (blocks, 12 * 8)
    id: NDArray[np.int32]  # (blocks * 8,) primitive id in the scene, -1 in the padding
    count: int  # blocks * 8


class RectangleBlocks(NamedTuple):
    """Corner, edges and normal of eight rectangles a block."""

    rows: NDArray[np.float32]  # (blocks, 12 * 8)
    id: NDArray[np.int32]
    count: int


class DiskBlocks(NamedTuple):
    """Centre, edges and normal of eight disks a block."""

    rows: NDArray[np.float32]  # (blocks, 12 * 8)
    id: NDArray[np.int32]
    count: int


class SphereBlocks(NamedTuple):
    """Centre and radius of eight spheres a block."""

    rows: NDArray[np.float32]  # (blocks, 4 * 8)
    id: NDArray[np.int32]
    count: int


class CylinderBlocks(NamedTuple):
    """Base, axis, radius and height of eight cylinders a block."""

    rows: NDArray[np.float32]  # (blocks, 8 * 8)
    id: NDArray[np.int32]
    count: int


_BLOCKS = {
    Triangles: TriangleBlocks,
    Rectangles: RectangleBlocks,
    Disks: DiskBlocks,
    Spheres: SphereBlocks,
    Cylinders: CylinderBlocks,
}


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
    *fields, ids, count = record
    rows = np.concatenate([np.atleast_2d(field)[:, :count] for field in fields])
    rows[:, columns < 0] = np.nan  # zeros would be a sphere at the origin
    eights = rows.reshape(len(rows), -1, WIDTH).swapaxes(0, 1)
    blocks = aligned_bytes(4 * eights.size).view(np.float32).reshape(eights.shape)
    blocks[...] = eights
    return _BLOCKS[type(record)](
        blocks.reshape(len(blocks), -1),
        np.where(columns < 0, np.int32(-1), ids[:count]),
        count,
    )


@kernel
def _three(rows, block, row):
    return vec3(
        load_eight(rows, block, 8 * row),
        load_eight(rows, block, 8 * row + 8),
        load_eight(rows, block, 8 * row + 16),
    )


@kernel
def patches_in(blocks, block):
    """Return the eight flat primitives of a block as lanes."""
    rows = blocks.rows
    return Patch(
        _three(rows, block, 0),
        _three(rows, block, 3),
        _three(rows, block, 6),
        _three(rows, block, 9),
    )


@kernel
def spheres_in(blocks, block):
    """Return the eight spheres of a block as lanes."""
    return Sphere(_three(blocks.rows, block, 0), load_eight(blocks.rows, block, 24))


@kernel
def cylinders_in(blocks, block):
    """Return the eight cylinders of a block as lanes."""
    return Cylinder(
        _three(blocks.rows, block, 0),
        _three(blocks.rows, block, 3),
        load_eight(blocks.rows, block, 48),
        load_eight(blocks.rows, block, 56),
    )


@kernel
def _column(rows, block, row, j):
    place = 8 * row + j
    return vec3(
        load_one(rows, block, place),
        load_one(rows, block, place + 8),
        load_one(rows, block, place + 16),
    )


@kernel
def patch_in(blocks, k):
    """Return flat primitive k as scalars."""
    block, j = k >> 3, k & 7
    rows = blocks.rows
    return Patch(
        _column(rows, block, 0, j),
        _column(rows, block, 3, j),
        _column(rows, block, 6, j),
        _column(rows, block, 9, j),
    )


@kernel
def sphere_in(blocks, k):
    """Return sphere k as scalars."""
    block, j = k >> 3, k & 7
    return Sphere(_column(blocks.rows, block, 0, j), load_one(blocks.rows, block, 24 + j))


@kernel
def cylinder_in(blocks, k):
    """Return cylinder k as scalars."""
    block, j = k >> 3, k & 7
    rows = blocks.rows
    return Cylinder(
        _column(rows, block, 0, j),
        _column(rows, block, 3, j),
        load_one(rows, block, 48 + j),
        load_one(rows, block, 56 + j),
    )


_FETCH_EIGHT = {
    TriangleBlocks: patches_in,
    RectangleBlocks: patches_in,
    DiskBlocks: patches_in,
    SphereBlocks: spheres_in,
    CylinderBlocks: cylinders_in,
}


def primitives_in(blocks: Any, block: int) -> Any:
    """Return the eight primitives of a block as lanes."""
    raise TypeError("inside kernels only")


@overload(primitives_in)
def _primitives_in(blocks, block):
    fetch = _FETCH_EIGHT.get(record_class(blocks))
    return None if fetch is None else lambda blocks, block: fetch(blocks, block)
