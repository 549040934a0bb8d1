"""Checkerboards whose colours are textures: at each point one of these is looked up.

So a board has no table. It only selects the texture whose table is read.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import mask_bits, select
from renderer.kernels.lanes.memory import gather_row, load_row
from renderer.plugins.textures.checkerboard import children, in_same_half
from renderer.scene_file.description import CheckerboardTexture


class NestedBoards(NamedTuple):
    """Columns by texture id."""

    child: NDArray[np.int32]  # (2, n) texture ids of the colours, -1: it is no such board


def nested_boards(textures: list[Any]) -> NestedBoards | None:
    """Return the boards among textures, or None without a board."""
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
    """Return the textures that are looked up in the end, by id.

    `swapped`: a number is looked up, for which Mitsuba exchanges a board's two colours.
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
