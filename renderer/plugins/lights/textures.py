"""Textures of lights: colours at (u, v) by light id."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.plugins.textures.kind import TextureKind, TexturePoint, texture_color
from renderer.plugins.textures.look_up import to_uv_of
from renderer.scene_file.description import CheckerboardTexture


class LightTextures(NamedTuple):
    """Textures of one kind and format; columns by light id."""

    table: Any  # table of the kind
    to_uv: NDArray[np.float32]  # (6, n)


def light_textures(
    count: int, kind: TextureKind, textures: dict[int, Any], scene: Any
) -> LightTextures:
    """Pack the textures of one kind and format: texture by light id."""
    to_uv = [getattr(textures.get(i), "to_uv", np.eye(3))[:2] for i in range(count)]
    return LightTextures(
        kind.table([textures.get(i) for i in range(count)], scene),
        np.ascontiguousarray(np.reshape(to_uv, (-1, 6)).T, np.float32),
    )


def refuse_nested(properties: Any, name: str, texture: Any) -> None:
    """Refuse a checkerboard of textures: a light can only look up a single texture."""
    if isinstance(texture, CheckerboardTexture):
        for color in (texture.color0, texture.color1):
            if not hasattr(color, "rgb"):
                properties.fail(name, "a checkerboard of textures", "two plain colours")


@kernel
def light_color(textures, light, u, v, prim, position, mask):
    """Return the colours of lights at (u, v)."""
    a, b = to_uv_of(textures.to_uv, light, u, v, mask)
    return texture_color(textures.table, light, TexturePoint(a, b, prim, position), mask)
