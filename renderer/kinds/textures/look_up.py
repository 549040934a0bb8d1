"""Stage 4, textures: parameters of a batch of points, looked up in one kind of texture."""

from __future__ import annotations

from renderer.jit import method_kernel
from renderer.kinds.textures.kind import texture_color
from renderer.lanes.functions import first_lanes, mask_bits
from renderer.lanes.memory import gather_row, load_row, store_where


@method_kernel
def look_up_kind(textures, bsdfs, kind, row, rows, points, start, stop):
    """Replace the parameter in `row` of points start .. stop - 1 where a texture gives it.

    A colour has three rows, a number one, which is given the first channel.
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
        a = gather_row(m, 0, texture, mine) * u + gather_row(m, 1, texture, mine) * v
        b = gather_row(m, 3, texture, mine) * u + gather_row(m, 4, texture, mine) * v
        a = a + gather_row(m, 2, texture, mine)
        b = b + gather_row(m, 5, texture, mine)
        color = texture_color(textures.table, texture, a, b, mine)
        store_where(points.parameters, row, i, color.x, mine)
        if rows == 3:
            store_where(points.parameters, row + 1, i, color.y, mine)
            store_where(points.parameters, row + 2, i, color.z, mine)
