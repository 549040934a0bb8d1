"""Checkerboards over (u, v): two colours, 2 x 2 fields in each unit square."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.kinds.textures.kind import TextureKind
from renderer.lanes.functions import floor
from renderer.lanes.memory import gather_row
from renderer.lanes.vectors import select3, vec3
from renderer.scene_file.description import CheckerboardTexture


class Checkerboards(NamedTuple):
    """Columns by texture id."""

    colors: NDArray[np.float32]  # (6, n) the two colours


def board_table(textures: list[CheckerboardTexture | None]) -> Checkerboards:
    """Pack checkerboards into one record."""
    colors = [(*b.color0, *b.color1) if b else (0.0,) * 6 for b in textures]
    return Checkerboards(np.ascontiguousarray(np.array(colors, np.float32).T))


@kernel
def board_color(boards, texture, u, v, mask):
    """Return color0 where both of u and v are in the same half of their unit square."""
    same = (u - floor(u) > 0.5) ^ ~(v - floor(v) > 0.5)
    first = vec3(
        gather_row(boards.colors, 0, texture, mask),
        gather_row(boards.colors, 1, texture, mask),
        gather_row(boards.colors, 2, texture, mask),
    )
    second = vec3(
        gather_row(boards.colors, 3, texture, mask),
        gather_row(boards.colors, 4, texture, mask),
        gather_row(boards.colors, 5, texture, mask),
    )
    return select3(same, first, second)


CHECKERBOARD = TextureKind(
    "checkerboard", CheckerboardTexture, board_table, Checkerboards, board_color
)
