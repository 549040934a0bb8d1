"""Registers all kinds of texture."""

from __future__ import annotations

from typing import Any

from renderer.plugins.textures.bitmap import BITMAP
from renderer.plugins.textures.checkerboard import CHECKERBOARD
from renderer.plugins.textures.kind import TextureKind, texture_color, texture_scalar
from renderer.plugins.textures.mesh_attribute import MESH_ATTRIBUTE
from renderer.plugins.textures.uniform import UNIFORM
from renderer.plugins.textures.volume import VOLUME

TEXTURES: dict[str, TextureKind] = {}

for _kind in (BITMAP, CHECKERBOARD, MESH_ATTRIBUTE, VOLUME, UNIFORM):
    texture_color.by(_kind.table_class)(_kind.color)
    texture_scalar.by(_kind.table_class)(_kind.scalar)
    TEXTURES[_kind.name] = _kind


def kind_of_texture(texture: Any) -> TextureKind | None:
    """Return the kind of a texture of the description; None for constants."""
    for kind in TEXTURES.values():
        if isinstance(texture, kind.description):
            return kind
    return None


def mean_of(texture: Any) -> float:
    """Return the mean over uv of a parameter as a scalar.

    Used for decisions per BSDF, such as the sampling probability of a lobe.
    """
    kind = kind_of_texture(texture)
    return float(texture) if kind is None else kind.mean(texture, mean_of)
