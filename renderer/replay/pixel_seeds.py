"""The seeds of Mitsuba's scalar variants for the sampler of each pixel.

A film is divided into square blocks, numbered along a spiral from the middle. Inside a
block pixels are numbered along the Morton curve [Morton1966]. The seed of a pixel is the
number of pixels before it, counting every block as full, plus the render's seed times the
pixels of the film, modulo 2^32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BLOCK_SIZE = 32
"""Mitsuba's block size for films with at least as many blocks as workers. For smaller films
Mitsuba takes smaller blocks, so pictures depend on the number of workers. Therefore the
harness writes this number into the file's integrator."""


def pixel_seeds(
    width: int, height: int, seed: int, block_size: int = BLOCK_SIZE
) -> NDArray[np.uint32]:
    """Return the seed of each pixel.

    Parameters
    ----------
    width, height : int
        Size of the crop window [pixels].
    seed : int
        Seed of the render.
    block_size : int
        Side of a block [pixels], a power of two.

    Returns
    -------
    ndarray of shape (height, width)
        The argument of `Sampler::seed`.
    """
    blocks = spiral_numbers(-(-width // block_size), -(-height // block_size))
    y, x = np.mgrid[:height, :width]
    before = blocks[y // block_size, x // block_size] * block_size**2
    inside = morton_number(x % block_size, y % block_size)
    return ((seed * width * height + before + inside) % 2**32).astype(np.uint32)


def morton_number(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return indices along the Morton curve: the bits of x and y interleaved, x lowest."""
    number = np.zeros(np.broadcast(x, y).shape, np.int64)
    for bit in range(16):
        number |= ((x >> bit) & 1) << (2 * bit) | ((y >> bit) & 1) << (2 * bit + 1)
    return number


def spiral_numbers(columns: int, rows: int) -> NDArray[np.int64]:
    """Return the index of each block along the spiral, (rows, columns).

    It starts at block (columns // 2, rows // 2) and goes right, down, left, up by 1, 1, 2,
    2, 3, 3, ... steps. Positions outside of the film are not counted.
    """
    numbers = np.full((rows, columns), -1, np.int64)
    x, y = columns // 2, rows // 2
    number, arm = 0, 1
    turns = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    while number < numbers.size:
        for dx, dy in turns[:2] if arm % 2 else turns[2:]:
            for _ in range(arm):
                if 0 <= x < columns and 0 <= y < rows:
                    numbers[y, x] = number
                    number += 1
                x, y = x + dx, y + dy
        arm += 1
    return numbers
