"""Textures: bitmaps (nearest, bilinear) and checkerboards over (u, v)."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.lanes.functions import (
    floor,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    to_f32,
    to_i32,
)
from renderer.lanes.memory import gather_row
from renderer.vectors import gather3, select3, vec3

REPEAT = 0
MIRROR = 1
CLAMP = 2


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
def _texel(textures, start, width, height, mode, x, y, mask):
    column = _wrap(x, width, mode)
    row = _wrap(y, height, mode)
    return gather3(textures.texels, start + row * width + column, mask)


@kernel
def _bitmap(textures, texture, u, v, mask):
    """Return the colour at (u, v); v runs upwards, rows downwards."""
    start = gather_row(textures.start, 0, texture, mask)
    width = gather_row(textures.width, 0, texture, mask)
    height = gather_row(textures.height, 0, texture, mask)
    mode = gather_row(textures.wrap, 0, texture, mask)
    nearest = gather_row(textures.nearest, 0, texture, mask) != 0
    half = select(nearest, splat_f32(0.0), splat_f32(0.5))
    x = u * to_f32(width) - half
    y = (1.0 - v) * to_f32(height) - half
    x0 = floor(x)
    y0 = floor(y)
    column = to_i32(x0)
    row = to_i32(y0)
    color = _texel(textures, start, width, height, mode, column, row, mask)
    smooth = mask & ~nearest
    if mask_bits(smooth) == 0:
        return color
    fx = x - x0
    fy = y - y0
    right = _texel(textures, start, width, height, mode, column + 1, row, smooth)
    below = _texel(textures, start, width, height, mode, column, row + 1, smooth)
    across = _texel(textures, start, width, height, mode, column + 1, row + 1, smooth)
    upper = color * (1.0 - fx) + right * fx
    lower = below * (1.0 - fx) + across * fx
    return select3(smooth, upper * (1.0 - fy) + lower * fy, color)


@kernel
def _checkerboard(textures, texture, u, v, mask):
    """Return color0 where both of u and v are in the same half of their unit square."""
    same = (u - floor(u) > 0.5) ^ ~(v - floor(v) > 0.5)
    first = vec3(
        gather_row(textures.colors, 0, texture, mask),
        gather_row(textures.colors, 1, texture, mask),
        gather_row(textures.colors, 2, texture, mask),
    )
    second = vec3(
        gather_row(textures.colors, 3, texture, mask),
        gather_row(textures.colors, 4, texture, mask),
        gather_row(textures.colors, 5, texture, mask),
    )
    return select3(same, first, second)


@kernel
def eval_texture(textures, texture_of, material, u, v, constant, mask):
    """Return the colours at (u, v) of the textures `texture_of[material]`.

    Lanes whose texture id is -1 get `constant`.
    """
    if textures is None:
        return constant
    texture = gather_row(texture_of, 0, material, mask)
    mine = mask & (texture >= 0)
    if mask_bits(mine) == 0:
        return constant
    m = textures.to_uv
    a = gather_row(m, 0, texture, mine) * u + gather_row(m, 1, texture, mine) * v
    b = gather_row(m, 3, texture, mine) * u + gather_row(m, 4, texture, mine) * v
    a = a + gather_row(m, 2, texture, mine)
    b = b + gather_row(m, 5, texture, mine)
    is_bitmap = gather_row(textures.start, 0, texture, mine) >= splat_i32(0)
    color = constant
    if mask_bits(mine & is_bitmap) != 0:
        bitmap = _bitmap(textures, texture, a, b, mine & is_bitmap)
        color = select3(mine & is_bitmap, bitmap, color)
    if mask_bits(mine & ~is_bitmap) != 0:
        board = _checkerboard(textures, texture, a, b, mine & ~is_bitmap)
        color = select3(mine & ~is_bitmap, board, color)
    return color
