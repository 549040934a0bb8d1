"""How the brightness of bitmaps changes with u and v: for bumps.

It is the slope of the plane through the four texels around a point; where a bitmap shows
the nearest texel alone it is 0, as there are steps and nothing between them.
"""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel, method_kernel
from renderer.kinds.textures.bitmap import texel
from renderer.lanes.functions import (
    first_lanes,
    floor,
    mask_bits,
    select,
    splat_f32,
    to_f32,
    to_i32,
)
from renderer.lanes.memory import gather_row, load_row, store_where

_RED, _GREEN, _BLUE = (np.float32(c) for c in (0.212671, 0.715160, 0.072169))


@kernel
def _brightness(bitmaps, start, width, height, mode, x, y, mask):
    color = texel(bitmaps, start, width, height, mode, x, y, mask)
    return color.x * _RED + color.y * _GREEN + color.z * _BLUE


@kernel
def _slope(bitmaps, texture, u, v, mask):
    """Return the derivatives by the transformed (u, v); v runs upwards, rows downwards."""
    start = gather_row(bitmaps.start, 0, texture, mask)
    width = gather_row(bitmaps.width, 0, texture, mask)
    height = gather_row(bitmaps.height, 0, texture, mask)
    mode = gather_row(bitmaps.wrap, 0, texture, mask)
    nearest = gather_row(bitmaps.nearest, 0, texture, mask) != 0
    x = u * to_f32(width) - 0.5
    y = (1.0 - v) * to_f32(height) - 0.5
    x0, y0 = floor(x), floor(y)
    fx, fy = x - x0, y - y0
    i, j = to_i32(x0), to_i32(y0)
    here = _brightness(bitmaps, start, width, height, mode, i, j, mask)
    right = _brightness(bitmaps, start, width, height, mode, i + 1, j, mask)
    below = _brightness(bitmaps, start, width, height, mode, i, j + 1, mask)
    across = _brightness(bitmaps, start, width, height, mode, i + 1, j + 1, mask)
    by_x = (right - here) * (1.0 - fy) + (across - below) * fy
    by_y = (below - here) * (1.0 - fx) + (across - right) * fx
    none = splat_f32(0.0)
    return select(nearest, none, by_x), select(nearest, none, -by_y)


@method_kernel
def look_up_gradient(textures, bsdfs, kind, row, rows, points, start, stop):
    """Replace the slope in two rows from `row` on where a bitmap gives it.

    The map of uv comes before the size of the image, as in Mitsuba: where the map turns
    the image, and it is no square, the slope is not quite that of what is seen.
    """
    m = textures.to_uv
    for i in range(start, stop, 16):
        bsdf = load_row(points.bsdf, 0, i)
        shown = first_lanes(stop - i) & (bsdf >= 0)
        texture = gather_row(bsdfs.texture, row, bsdf, shown)
        textured = shown & (texture >= 0)
        mine = textured & (gather_row(bsdfs.texture_kind, 0, texture, textured) == kind)
        if mask_bits(mine) == 0:
            continue
        u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
        m_uu, m_uv = gather_row(m, 0, texture, mine), gather_row(m, 1, texture, mine)
        m_vu, m_vv = gather_row(m, 3, texture, mine), gather_row(m, 4, texture, mine)
        a = m_uu * u + m_uv * v + gather_row(m, 2, texture, mine)
        b = m_vu * u + m_vv * v + gather_row(m, 5, texture, mine)
        x, y = _slope(textures.table, texture, a, b, mine)
        width = to_f32(gather_row(textures.table.width, 0, texture, mine))
        height = to_f32(gather_row(textures.table.height, 0, texture, mine))
        store_where(points.parameters, row, i, (m_uu * x + m_vu * y) * width, mine)
        store_where(points.parameters, row + 1, i, (m_uv * x + m_vv * y) * height, mine)
