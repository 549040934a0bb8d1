"""Bitmaps over (u, v): the nearest texel, or the four around a point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.kinds.textures.kind import TextureKind
from renderer.lanes.functions import (
    floor,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    to_f32,
    to_i32,
)
from renderer.lanes.memory import gather_row
from renderer.lanes.vectors import gather3, select3
from renderer.scene_file.description import BitmapTexture

REPEAT = 0
MIRROR = 1
CLAMP = 2
_WRAP = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}


class Bitmaps(NamedTuple):
    """All bitmaps in one long row of texels; columns by texture id."""

    texels: NDArray[np.float32]  # (3, total), row after row from the top
    start: NDArray[np.int32]  # (n,) first texel
    width: NDArray[np.int32]  # (n,)
    height: NDArray[np.int32]  # (n,)
    nearest: NDArray[np.int32]  # (n,) 1: no interpolation
    wrap: NDArray[np.int32]  # (n,) REPEAT, MIRROR or CLAMP


def bitmap_table(textures: list[BitmapTexture | None]) -> Bitmaps:
    """Pack bitmaps into one record."""
    texels, starts, widths, heights = [np.zeros((3, 1), np.float32)], [], [], []
    total = 1
    for bitmap in textures:
        height, width = bitmap.pixels.shape[:2] if bitmap else (1, 1)
        starts.append(total if bitmap else 0)
        widths.append(width)
        heights.append(height)
        if bitmap:
            texels.append(bitmap.pixels.reshape(-1, 3).T)
            total += width * height
    return Bitmaps(
        np.ascontiguousarray(np.concatenate(texels, axis=1), np.float32),
        np.array(starts, np.int32),
        np.array(widths, np.int32),
        np.array(heights, np.int32),
        np.array(
            [b is not None and b.filter_type == "nearest" for b in textures], np.int32
        ),
        np.array([_WRAP[b.wrap_mode] if b else REPEAT for b in textures], np.int32),
    )


@kernel
def _wrap(i, size, mode):
    """Return texel coordinates brought into [0, size)."""
    n = to_f32(size)
    x = to_f32(i)
    period = floor(x / n)
    repeated = x - period * n
    # every other period of a mirrored image runs backwards
    odd = period - 2.0 * floor(period * 0.5) != 0.0
    mirrored = select(odd, n - 1.0 - repeated, repeated)
    clamped = minimum(maximum(x, splat_f32(0.0)), n - 1.0)
    wrapped = select(mode == CLAMP, clamped, select(mode == MIRROR, mirrored, repeated))
    # the division may round up to a whole period
    return to_i32(minimum(maximum(wrapped, splat_f32(0.0)), n - 1.0))


@kernel
def texel(bitmaps, start, width, height, mode, x, y, mask):
    """Return the colour in column x and row y, wherever these are."""
    column = _wrap(x, width, mode)
    row = _wrap(y, height, mode)
    return gather3(bitmaps.texels, start + row * width + column, mask)


@kernel
def bitmap_color(bitmaps, texture, u, v, mask):
    """Return the colour at (u, v); v runs upwards, rows downwards."""
    start = gather_row(bitmaps.start, 0, texture, mask)
    width = gather_row(bitmaps.width, 0, texture, mask)
    height = gather_row(bitmaps.height, 0, texture, mask)
    mode = gather_row(bitmaps.wrap, 0, texture, mask)
    nearest = gather_row(bitmaps.nearest, 0, texture, mask) != 0
    half = select(nearest, splat_f32(0.0), splat_f32(0.5))
    x = u * to_f32(width) - half
    y = (1.0 - v) * to_f32(height) - half
    x0 = floor(x)
    y0 = floor(y)
    column = to_i32(x0)
    row = to_i32(y0)
    color = texel(bitmaps, start, width, height, mode, column, row, mask)
    smooth = mask & ~nearest
    if mask_bits(smooth) == 0:
        return color
    fx = x - x0
    fy = y - y0
    right = texel(bitmaps, start, width, height, mode, column + 1, row, smooth)
    below = texel(bitmaps, start, width, height, mode, column, row + 1, smooth)
    across = texel(bitmaps, start, width, height, mode, column + 1, row + 1, smooth)
    upper = color * (1.0 - fx) + right * fx
    lower = below * (1.0 - fx) + across * fx
    return select3(smooth, upper * (1.0 - fy) + lower * fy, color)


BITMAP = TextureKind("bitmap", BitmapTexture, bitmap_table, Bitmaps, bitmap_color)
