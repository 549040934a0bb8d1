"""All kinds of texture: one line makes a kind known."""

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
    """Return the kind of a texture of the description; None for plain numbers."""
    for kind in TEXTURES.values():
        if isinstance(texture, kind.description):
            return kind
    return None


def mean_of(texture: Any) -> float:
    """Return the mean over u and v of a parameter as one number, or the number it is.

    For decisions that are made once for a BSDF, such as how often a lobe is sampled.
    """
    kind = kind_of_texture(texture)
    return float(texture) if kind is None else kind.mean(texture, mean_of)
