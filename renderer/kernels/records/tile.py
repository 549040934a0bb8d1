"""Tiles of the film, and the slots of a tile: one for each sample of each of its pixels.

4^level samples of a pixel are traced together. Each has a place on a grid that is 2^level
times as fine as the film, where the samples of a pixel lie side by side. A batch is a
square of the tile, of 32 x 32 places. So the rays of a batch, and the 16 of a packet, lie
as close to each other as those of a film of 4^level times as many pixels. No number depends
on it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import as_u32


class Tile(NamedTuple):
    """A rectangle of at most 32 x 32 pixels, in coordinates of the full film."""

    x: int
    y: int
    width: int
    height: int
    film_width: int  # of the full film
    level: int = 0  # 4 ** level samples of each pixel are traced together
    square: int = 0  # of as many, the one that is traced


class SampleKey(NamedTuple):
    """What the random numbers of samples hang on, beside the first of their numbers."""

    pixel: Any  # (16,) uint32 number in the full film
    later: Any  # (16,) uint32 by how much a sample's number is larger than the first one


TILE_SIZE = 32  # CAPACITY = TILE_SIZE ** 2
_SIDE_BITS = 5  # of a place's x, and y, in its square
_SQUARE_BITS = 10  # of a slot, below the number of its square


@kernel
def _place(slot, level):
    """Return the (x, y) of slots on the fine grid; 16 neighbours are 4 x 4 places."""
    square = slot >> _SQUARE_BITS
    across, down = square & ((1 << level) - 1), square >> level
    x = (slot & 3) | (((slot >> 4) & 7) << 2) | (across << _SIDE_BITS)
    y = ((slot >> 2) & 3) | (((slot >> 7) & 7) << 2) | (down << _SIDE_BITS)
    return x, y


@kernel
def slot_pixel(slot, level):
    """Return the (x, y) of slots in a tile."""
    x, y = _place(slot, level)
    return x >> level, y >> level


@kernel
def pixel_slot(x, y, later, level):
    """Return the slot of sample `later`, of those together, of the pixel (x, y)."""
    inside = (1 << level) - 1
    x = (x << level) | (later & inside)
    y = (y << level) | (later >> level)
    square = (x >> _SIDE_BITS) | ((y >> _SIDE_BITS) << level)
    x, y = x & (TILE_SIZE - 1), y & (TILE_SIZE - 1)
    slot = (x & 3) | ((y & 3) << 2) | ((x >> 2) << 4) | ((y >> 2) << 7)
    return slot | (square << _SQUARE_BITS)


@kernel
def sample_key(tile, slot):
    """Return the key of the random numbers of slots."""
    x, y = _place(slot, tile.level)
    inside = (1 << tile.level) - 1
    later = (x & inside) | ((y & inside) << tile.level)
    row = (y >> tile.level) + tile.y
    pixel = row * tile.film_width + (x >> tile.level) + tile.x
    return SampleKey(as_u32(pixel), as_u32(later))


@kernel
def has_places(tile):
    """Return whether the tile's square has a pixel: at an edge of the film it may not."""
    x, y = slot_pixel(tile.square << _SQUARE_BITS, tile.level)
    return x < tile.width and y < tile.height
