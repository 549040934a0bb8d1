"""Texture look-ups at surface points, including checkerboards of textures.

A checkerboard whose colours are textures has no table: at each point it selects the texture
that is looked up.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits, select
from renderer.kernels.lanes.memory import gather_row, load_row, store_where
from renderer.kernels.lanes.vectors import load3
from renderer.plugins.textures.checkerboard import children, in_same_half
from renderer.plugins.textures.kind import TexturePoint, texture_color, texture_scalar
from renderer.scene_file.description import CheckerboardTexture


class NestedBoards(NamedTuple):
    """Columns by texture id."""

    child: NDArray[np.int32]  # (2, n) texture ids of the colours, -1: not such a board


def nested_boards(textures: list[Any]) -> NestedBoards | None:
    """Return the boards of textures among `textures`, or None if there are none."""
    ids = {id(texture): k for k, texture in enumerate(textures)}
    child = np.full((2, len(textures)), -1, np.int32)
    for k, texture in enumerate(textures):
        if isinstance(texture, CheckerboardTexture) and (colors := children(texture)):
            child[:, k] = [ids[id(color)] for color in colors]
    return NestedBoards(child) if (child >= 0).any() else None


@kernel
def to_uv_of(m, texture, u, v, mask):
    """Return (u, v) transformed by the first two rows of the textures' affine maps."""
    a = gather_row(m, 0, texture, mask) * u + gather_row(m, 1, texture, mask) * v
    b = gather_row(m, 3, texture, mask) * u + gather_row(m, 4, texture, mask) * v
    return a + gather_row(m, 2, texture, mask), b + gather_row(m, 5, texture, mask)


@kernel
def chosen_texture(nested, to_uv, texture, swapped, points, i, mask):
    """Return the ids of the textures that are looked up, inside of nested boards.

    `swapped`: for scalars, where Mitsuba exchanges the two colours of a board.
    """
    if nested is None:
        return texture
    u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
    while True:
        first = gather_row(nested.child, 0, texture, mask)
        board = mask & (first >= 0)
        if mask_bits(board) == 0:
            return texture
        second = gather_row(nested.child, 1, texture, board)
        a, b = to_uv_of(to_uv, texture, u, v, board)
        same = in_same_half(a, b)
        chosen = select(same, second, first) if swapped else select(same, first, second)
        texture = select(board, chosen, texture)


# ------------------------------------------------------------------------------ look up
# Stage 4, textures: parameters of a batch of points, from one kind of texture.
#
# There is one method for each result: a colour, a scalar and a gradient (`gradient.py`).
# Methods that the scene does not use are not compiled.


@kernel
def textures_of(textures, bsdfs, kind, row, points, i, stop, swapped):
    """Return the textures of the parameter in `row`, and the mask of those of this kind."""
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
    """Return the look-up points of points i to i + 15."""
    u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
    a, b = to_uv_of(textures.to_uv, texture, u, v, mask)
    return TexturePoint(a, b, load_row(points.prim, 0, i), load3(points.position, i))


@method_kernel
def look_up_color(textures, bsdfs, kind, row, points, start, stop):
    """Replace the colour in `row` of points start .. stop - 1 where it has a texture."""
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
    """Replace the scalar in `row`, as `look_up_color` does."""
    for i in range(start, stop, 16):
        texture, mine = textures_of(textures, bsdfs, kind, row, points, i, stop, True)
        if mask_bits(mine) == 0:
            continue
        point = point_of(textures, texture, points, i, mine)
        number = texture_scalar(textures.table, texture, point, mine)
        store_where(points.parameters, row, i, number, mine)
