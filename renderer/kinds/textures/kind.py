"""What a kind of texture is, and what the stages ask of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import interface


class TextureMethods(NamedTuple):
    """The record that the kernels of one kind are given; columns by texture id."""

    table: Any  # of the kind
    to_uv: NDArray[np.float32]  # (6, n) first two rows of the affine map


@dataclass(frozen=True)
class TextureKind:
    """One kind of texture."""

    name: str  # of the plugin
    description: type
    table: Callable[[list[Any]], Any]  # descriptions by texture id, None: another kind's
    table_class: type
    color: Any  # (table, texture, u, v, mask) -> RGB


@interface
def texture_color(table: Any, texture: Any, u: Any, v: Any, mask: Any) -> Any:
    """Return the colours of textures, by id, at the transformed (u, v)."""
