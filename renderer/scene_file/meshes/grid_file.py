"""Files of Mitsuba's grids of numbers (.vol, version 3).

All numbers are little endian: "VOL", a byte for the version, the type of the numbers (1:
float32), the grid points along x, y and z, the channels (32 bits each), six float32 of a
box (ignored by shapes), and the numbers: channels fastest, then x, and z slowest.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory

# Of the resulting shape, measured; a crossing is an edge between values of opposite sign.
_BYTES_A_POINT, _BYTES_A_CROSSING = 34, 500
_HEADER = struct.Struct("<3sB5i6f")


def read_grid(path: Path) -> NDArray[np.float32]:
    """Return the numbers of a shape's grid, (z, y, x).

    Raises
    ------
    SceneError
        As `read_channels`; also for several channels, or fewer than two points along an
        axis.
    """
    values, _ = read_channels(path)
    nz, ny, nx, channels = values.shape
    if channels != 1:
        raise SceneError(f"{path}: has {channels} channels; a shape's grid has 1")
    if min(nx, ny, nz) < 2:
        raise SceneError(
            f"{path}: has {nx} x {ny} x {nz} points; possible are 2 or more along an axis"
        )
    grid = values[..., 0]
    inside = grid > 0.0
    crossing = sum(int(np.count_nonzero(np.diff(inside, axis=axis))) for axis in range(3))
    size = _BYTES_A_POINT * grid.size + _BYTES_A_CROSSING * crossing
    memory.require(size, f"{path}: the grid")
    return grid


def read_channels(path: Path) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the numbers of a file, (z, y, x, channels), and its box, (2, 3).

    Raises
    ------
    SceneError
        For another format, version or type, no points along an axis, fewer numbers than
        in the header, or a number that is not finite.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot read it: {error.strerror}") from None
    if len(content) < _HEADER.size:
        raise SceneError(
            f"{path}: has {len(content)} bytes; the header of a grid has {_HEADER.size}"
        )
    mark, version, kind, nx, ny, nz, channels, *box = _HEADER.unpack_from(content)
    if mark != b"VOL" or version != 3:
        raise SceneError(
            f"{path}: begins with {mark!r} and version {version}; a grid begins with "
            "b'VOL' and version 3"
        )
    if kind != 1:
        raise SceneError(f"{path}: has numbers of type {kind}; possible is 1, float32")
    if min(nx, ny, nz, channels) < 1:
        raise SceneError(
            f"{path}: has {nx} x {ny} x {nz} points of {channels} channels; possible are 1 "
            "or more of each"
        )
    there = (len(content) - _HEADER.size) // 4
    count = nx * ny * nz * channels
    if count > there:
        raise SceneError(
            f"{path}: promises {nx} x {ny} x {nz} points of {channels} numbers; there are "
            f"{there} numbers"
        )
    memory.require(3 * 4 * count, f"{path}: the grid")  # with the kernels' table of it
    numbers = np.frombuffer(content, "<f4", count, _HEADER.size)
    values = numbers.reshape(nz, ny, nx, channels).astype(np.float32)
    if (wrong := check_distances(values)) is not None:
        raise SceneError(f"{path}: has {wrong}; expected finite numbers")
    return values, np.array(box).reshape(2, 3)


def check_distances(grid: NDArray[np.float32]) -> str | None:
    """Return the first value that is not finite and its place, or None."""
    if np.isfinite(grid).all():
        return None
    z, y, x, *channel = np.argwhere(~np.isfinite(grid))[0]
    return f"{grid[z, y, x, *channel]} at x {x}, y {y}, z {z}"
