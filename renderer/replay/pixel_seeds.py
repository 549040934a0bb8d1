"""Which seed Mitsuba's scalar variants give the sampler of each pixel.

A film is cut into square blocks, which are numbered along a spiral that starts in the
middle; inside a block pixels are numbered along Morton's curve [Morton1966]. A pixel's seed
is the number of pixels before it, were every block full, plus the render's seed times the
pixels of the film; all modulo 2^32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BLOCK_SIZE = 32
"""Mitsuba's own, for a film with at least as many blocks as it has workers. For a smaller
film Mitsuba takes smaller blocks, so that its picture depends on the number of workers; the
harness therefore writes this number into the file's integrator."""


def pixel_seeds(
    width: int, height: int, seed: int, block_size: int = BLOCK_SIZE
) -> NDArray[np.uint32]:
    """Return the seed of each pixel.

    Parameters
    ----------
    width, height : int
        Of the crop window [pixels].
    seed : int
        Of the render.
    block_size : int
        Side of a block [pixels], a power of two.

    Returns
    -------
    ndarray of shape (height, width)
        What `Sampler::seed` is called with.
    """
    blocks = spiral_numbers(-(-width // block_size), -(-height // block_size))
    y, x = np.mgrid[:height, :width]
    before = blocks[y // block_size, x // block_size] * block_size**2
    inside = morton_number(x % block_size, y % block_size)
    return ((seed * width * height + before + inside) % 2**32).astype(np.uint32)


def morton_number(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers along Morton's curve: the bits of x and y in turn, x lowest."""
    number = np.zeros(np.broadcast(x, y).shape, np.int64)
    for bit in range(16):
        number |= ((x >> bit) & 1) << (2 * bit) | ((y >> bit) & 1) << (2 * bit + 1)
    return number


def spiral_numbers(columns: int, rows: int) -> NDArray[np.int64]:
    """Return the place of each block in the spiral, (rows, columns).

    It starts at block (columns // 2, rows // 2) and goes right, down, left, up by 1, 1, 2,
    2, 3, 3, ... steps; places outside of the film have no number.
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
