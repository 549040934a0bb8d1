"""All kinds of texture: one line makes a kind known."""

from __future__ import annotations

from renderer.kinds.textures.bitmap import BITMAP
from renderer.kinds.textures.checkerboard import CHECKERBOARD
from renderer.kinds.textures.kind import TextureKind, texture_color

TEXTURES: dict[str, TextureKind] = {}

for _kind in (BITMAP, CHECKERBOARD):
    texture_color.by(_kind.table_class)(_kind.color)
    TEXTURES[_kind.name] = _kind
