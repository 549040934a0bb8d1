"""Stage 4, textures: parameters of a batch of points, looked up in one kind of texture.

There is one method for each result: a colour, a number and a slope (`gradient.py`). Methods
that no BSDF of a scene uses are not compiled.
"""

from __future__ import annotations

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.lanes.memory import gather_row, load_row, store_where
from renderer.kernels.lanes.vectors import load3
from renderer.plugins.textures.kind import TexturePoint, texture_color, texture_scalar
from renderer.plugins.textures.nested import chosen_texture, to_uv_of


@kernel
def textures_of(textures, bsdfs, kind, row, points, i, stop, swapped):
    """Return the textures that give the parameter in `row`, and which are of this kind."""
    bsdf = load_row(points.bsdf, 0, i)
    shown = first_lanes(stop - i) & (bsdf >= 0)
    texture = gather_row(bsdfs.texture, row, bsdf, shown)
    textured = shown & (texture >= 0)
    texture = chosen_texture(
        textures.nested, textures.to_uv, texture, swapped, points, i, textured
    )
    here = gather_row(bsdfs.texture_kind, 0, texture, textured) == kind
    return texture, textured & here


@kernel
def point_of(textures, texture, points, i, mask):
    """Return where textures are looked up for points i to i + 15."""
    u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
    a, b = to_uv_of(textures.to_uv, texture, u, v, mask)
    return TexturePoint(a, b, load_row(points.prim, 0, i), load3(points.position, i))


@method_kernel
def look_up_color(textures, bsdfs, kind, row, points, start, stop):
    """Replace the colour in `row` of points start .. stop - 1 where a texture gives it."""
    for i in range(start, stop, 16):
        texture, mine = textures_of(textures, bsdfs, kind, row, points, i, stop, False)
        if mask_bits(mine) == 0:
            continue
        point = point_of(textures, texture, points, i, mine)
        color = texture_color(textures.table, texture, point, mine)
        store_where(points.parameters, row, i, color.x, mine)
        store_where(points.parameters, row + 1, i, color.y, mine)
        store_where(points.parameters, row + 2, i, color.z, mine)


@method_kernel
def look_up_scalar(textures, bsdfs, kind, row, points, start, stop):
    """Replace the number in `row`, as `look_up_color` does."""
    for i in range(start, stop, 16):
        texture, mine = textures_of(textures, bsdfs, kind, row, points, i, stop, True)
        if mask_bits(mine) == 0:
            continue
        point = point_of(textures, texture, points, i, mine)
        number = texture_scalar(textures.table, texture, point, mine)
        store_where(points.parameters, row, i, number, mine)
