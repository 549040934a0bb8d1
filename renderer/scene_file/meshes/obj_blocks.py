"""Reads OBJ files in blocks of bytes, with kernels on all cores.

`obj_file` reads line by line and reports errors. This module reads what nearly all files
consist of: the usual number of numbers per line, and corners with indices from 1. For
anything else it returns None.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.process import memory
from renderer.process.worker_pool import default_threads, in_threads
from renderer.scene_file.meshes.mesh_data import is_number
from renderer.scene_file.meshes.obj_kernels import (
    LARGEST,
    UNUSUAL,
    count_lines,
    number_corners,
    read_lines,
)

Integers = NDArray[np.int64]

WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # numbers that are used on each line
KINDS = (*WIDTHS, "f")
_BLOCK = 1 << 20  # bytes; a thread reads the lines that begin in a block


class Blocks(NamedTuple):
    """The numbers of a file."""

    v: NDArray[np.float64]  # (n, 3)
    vt: NDArray[np.float64]  # (n, 2)
    vn: NDArray[np.float64]  # (n, 3)
    begins: tuple[Integers, ...]  # byte offset of the line of each row of v, vt, vn
    corners: NDArray[np.int32]  # (3, corners) indices of v, vt, vn from 1; 0: absent
    face_sizes: NDArray[np.int32]  # number of corners of each face
    other: Integers  # (n, 2): line number from 1 and byte offset of other lines


def read_blocks(
    content: bytes, *, face_normals: bool, what: str = "an OBJ file"
) -> Blocks | None:
    """Return the numbers of a file; None if it must be read line by line.

    Parameters
    ----------
    content
        Bytes of the file.
    face_normals
        Ignore the numbers of `vn` lines.
    what
        Beginning of the message about memory.

    Raises
    ------
    NotAllowed
        If the numbers and the mesh need more memory than is available.
    """
    if b"\\" in content:  # may join lines
        return None
    text = np.frombuffer(content, np.uint8)
    blocks = -(-len(text) // _BLOCK)
    counts = np.zeros((blocks + 1, 7), np.int64)
    states = np.zeros(blocks, np.int64)

    def count(block: int) -> None:
        count_lines(text, block * _BLOCK, (block + 1) * _BLOCK, counts[block + 1])

    in_threads(default_threads(), blocks, count)
    before = np.cumsum(counts, axis=0)
    _, v, vt, vn, faces, others, corners = before[-1].tolist()
    # numbers, line offsets, and the temporary arrays of `distinct` and of triangle fans
    rows, of_corners = 32 * (v + vn) + 24 * vt, 76 * corners + 12 * faces
    memory.require(rows + 4 * v + of_corners + 64 * others, what)
    found = Blocks(
        np.zeros((v, 3)),
        np.zeros((vt, 2)),
        np.zeros((vn, 3)),
        (np.empty(v, np.int64), np.empty(vt, np.int64), np.empty(vn, np.int64)),
        np.zeros((3, corners), np.int32),
        np.empty(faces, np.int32),
        np.empty((others, 2), np.int64),
    )
    most = np.array([v, vt, LARGEST if face_normals else vn])

    def read(block: int) -> None:
        part = block * _BLOCK, (block + 1) * _BLOCK, before[block]
        states[block] = read_lines(text, *part, most, not face_normals, *found)

    in_threads(default_threads(), blocks, read)
    if faces == 0 or (states == UNUSUAL).any():
        return None
    plain = not states.any() or all(
        _read_again(content, begins, rows)
        for begins, rows in zip(found.begins, found[:3], strict=True)
    )
    return found if plain else None


def _read_again(content: bytes, begins: Integers, rows: NDArray[np.float64]) -> bool:
    """Read rows that contain NaN again in Python; return whether all are numbers."""
    for k in np.flatnonzero(np.isnan(rows).any(axis=1)).tolist():
        end = content.find(b"\n", begins[k])
        line = content[begins[k] : end if end >= 0 else None]
        words = line.partition(b"#")[0].split()[1 : 1 + rows.shape[1]]
        if not all(map(is_number, words)):
            return False
        rows[k] = [float(word) for word in words]
    return True


def distinct(
    corners: NDArray[np.int32], positions: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Merge equal corners into vertices, in the order of their first use.

    Returns
    -------
    keys
        (V, 3) the distinct corners.
    vertex
        (corners,) the vertex of each corner.
    """
    count = corners.shape[1]
    keys = np.empty((count, 3), np.int32)
    vertex, following = np.empty((2, count), np.int32)
    newest = np.full(positions + 1, -1, np.int32)
    vertices = number_corners(corners, newest, following, keys, vertex)
    return (keys[:vertices], vertex) if vertices >= 0 else _distinct_by_sorting(corners)


def _distinct_by_sorting(
    corners: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the same by sorting, if one position has many uv or normals."""
    keys, first, vertex = np.unique(
        corners.T, axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    return np.ascontiguousarray(keys[order]), number[vertex.ravel()]
