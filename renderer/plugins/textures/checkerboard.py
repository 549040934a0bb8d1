"""Checkerboard textures: two colours, 2 x 2 fields per unit square of (u, v)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import floor, select
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather_rows3, select3
from renderer.plugins.textures.kind import TextureKind
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import CheckerboardTexture, ConstantTexture, Texture
from renderer.scene_file.objects.objects import read_texture


class Checkerboards(NamedTuple):
    """Columns by texture id."""

    colors: NDArray[np.float32]  # (6, n) the two colours
    numbers: NDArray[np.float32]  # (2, n) the two values as scalars


def read(properties: Any, use: Use) -> CheckerboardTexture:
    """Read the properties of a file; the colours may be textures."""
    if use is Use.EMISSION:
        use = Use.REFLECTANCE  # Mitsuba limits the colours to [0, 1], even for lights
    return CheckerboardTexture(
        read_texture(properties, "color0", 0.4, use),
        read_texture(properties, "color1", 0.2, use),
        properties.uv_transform("to_uv"),
    )


def children(board: CheckerboardTexture) -> tuple[Texture, Texture] | None:
    """Return the textures that are a board's colours; None if both are constant."""
    colors = board.color0, board.color1
    return None if all(isinstance(c, ConstantTexture) for c in colors) else colors


def mean(board: CheckerboardTexture, mean_of: Callable[[Any], float]) -> float:
    """Return the mean of both colours."""
    return 0.5 * (mean_of(board.color0) + mean_of(board.color1))


def board_table(textures: list[CheckerboardTexture | None], scene: Any) -> Checkerboards:
    """Pack checkerboards of constant colours into one record."""
    colors = np.zeros((len(textures), 2, 3))
    for board, both in zip(textures, colors, strict=True):
        if board is not None:
            both[:] = [board.color0.rgb, board.color1.rgb]  # type: ignore[union-attr]
    return Checkerboards(
        np.ascontiguousarray(colors.reshape(-1, 6).T, np.float32),
        np.ascontiguousarray(colors.mean(axis=2).T, np.float32),
    )


@kernel
def in_same_half(u, v):
    """Return where both of u and v are in the same half of their unit square."""
    return (u - floor(u) > 0.5) ^ ~(v - floor(v) > 0.5)


@kernel
def board_color(boards, texture, point, mask):
    """Return color0 where u and v are in the same half, else color1."""
    first = gather_rows3(boards.colors, 0, texture, mask)
    second = gather_rows3(boards.colors, 3, texture, mask)
    return select3(in_same_half(point.u, point.v), first, second)


@kernel
def board_scalar(boards, texture, point, mask):
    """Return color1 where u and v are in the same half: Mitsuba swaps them for scalars."""
    first = gather_row(boards.numbers, 0, texture, mask)
    second = gather_row(boards.numbers, 1, texture, mask)
    return select(in_same_half(point.u, point.v), second, first)


CHECKERBOARD = TextureKind(
    "checkerboard",
    CheckerboardTexture,
    read,
    board_table,
    Checkerboards,
    board_color,
    board_scalar,
    mean,
)
