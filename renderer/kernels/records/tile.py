"""Tiles of the film, and the slots of a batch: one for each pixel of a tile."""

from __future__ import annotations

from typing import NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import as_u32


class Tile(NamedTuple):
    """A rectangle of at most 32 x 32 pixels, in coordinates of the full film."""

    x: int
    y: int
    width: int
    height: int
    film_width: int  # of the full film


TILE_SIZE = 32  # CAPACITY = TILE_SIZE ** 2


@kernel
def slot_pixel(slot):
    """Return the (x, y) of slots in a tile; 16 neighbouring slots are 4 x 4 pixels."""
    x = (slot & 3) | (((slot >> 4) & 7) << 2)
    y = ((slot >> 2) & 3) | ((slot >> 7) << 2)
    return x, y


@kernel
def pixel_key(tile, slot):
    """Return the number of the slots' pixels in the full film: the key of their numbers."""
    x, y = slot_pixel(slot)
    return as_u32((y + tile.y) * tile.film_width + (x + tile.x))
