"""Derivatives of bitmaps by u and v, for bump maps.

The gradient is that of bilinear interpolation of the four texels around a point. It is 0
for a bitmap without interpolation, which is piecewise constant.
"""

from __future__ import annotations

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import (
    floor,
    mask_bits,
    select,
    splat_f32,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row, store_where
from renderer.plugins.textures.bitmap import NEAREST, wrapped
from renderer.plugins.textures.look_up import point_of, textures_of
from renderer.plugins.textures.texels import as_number, texel_at


@kernel
def _brightness(bitmaps, index, mask):
    return as_number(bitmaps.texels, texel_at(bitmaps.texels, index, mask))


@kernel
def _slope(bitmaps, texture, point, mask):
    """Return the derivatives by the transformed (u, v); v is up, rows go down."""
    start = gather_row(bitmaps.start, 0, texture, mask)
    width = gather_row(bitmaps.width, 0, texture, mask)
    height = gather_row(bitmaps.height, 0, texture, mask)
    mode = gather_row(bitmaps.mode, 0, texture, mask)
    nearest = (mode & NEAREST) != 0
    mode = mode & ~NEAREST
    x = point.u * to_f32(width) - 0.5
    y = (1.0 - point.v) * to_f32(height) - 0.5
    x0, y0 = floor(x), floor(y)
    fx, fy = x - x0, y - y0
    i, j = to_i32(x0), to_i32(y0)
    column, next_column = wrapped(i, width, mode), wrapped(i + 1, width, mode)
    row = start + wrapped(j, height, mode) * width
    next_row = start + wrapped(j + 1, height, mode) * width
    here = _brightness(bitmaps, row + column, mask)
    right = _brightness(bitmaps, row + next_column, mask)
    below = _brightness(bitmaps, next_row + column, mask)
    across = _brightness(bitmaps, next_row + next_column, mask)
    by_x = (right - here) * (1.0 - fy) + (across - below) * fy
    by_y = (below - here) * (1.0 - fx) + (across - right) * fx
    none = splat_f32(0.0)
    return select(nearest, none, by_x), select(nearest, none, -by_y)


@method_kernel
def look_up_gradient(textures, bsdfs, kind, row, points, start, stop):
    """Replace the gradient in two rows from `row` on where a bitmap gives it.

    As in Mitsuba, `to_uv` is applied before the size of the image. If `to_uv` rotates an
    image that is not square, the gradient differs slightly from that of the look-up.
    """
    m, table = textures.to_uv, textures.table
    for i in range(start, stop, 16):
        texture, mine = textures_of(textures, bsdfs, kind, row, points, i, stop, False)
        if mask_bits(mine) == 0:
            continue
        x, y = _slope(table, texture, point_of(textures, texture, points, i, mine), mine)
        m_uu, m_uv = gather_row(m, 0, texture, mine), gather_row(m, 1, texture, mine)
        m_vu, m_vv = gather_row(m, 3, texture, mine), gather_row(m, 4, texture, mine)
        width = to_f32(gather_row(table.width, 0, texture, mine))
        height = to_f32(gather_row(table.height, 0, texture, mine))
        store_where(points.parameters, row, i, (m_uu * x + m_vu * y) * width, mine)
        store_where(points.parameters, row + 1, i, (m_uv * x + m_vv * y) * height, mine)
