"""Textures: a colour for each (u, v)."""

from __future__ import annotations

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file.description import (
    BitmapTexture,
    CheckerboardTexture,
    ConstantTexture,
    MeshAttributeTexture,
    Texture,
)
from renderer.simple.vectors import Vector


def eval_texture(texture: Texture, u: float, v: float) -> Vector:
    """Return the colour at (u, v)."""
    match texture:
        case ConstantTexture():
            return np.array(texture.rgb)
        case CheckerboardTexture():
            s, t, _ = texture.to_uv @ (u, v, 1.0)
            same = (s % 1.0 > 0.5) == (t % 1.0 > 0.5)
            return eval_texture(texture.color0 if same else texture.color1, u, v)
        case MeshAttributeTexture():
            raise SceneError(
                f"{texture.location}: the simple path tracer has no texture mesh_attribute"
            )
        case BitmapTexture():
            s, t, _ = texture.to_uv @ (u, v, 1.0)
            return _bitmap(texture, s, t)


def _bitmap(texture: BitmapTexture, s: float, t: float) -> Vector:
    """Return the nearest texel, or the mean of four by distance (bilinear)."""
    height, width, _ = texture.pixels.shape
    x, y = s * width, (1.0 - t) * height  # v runs upwards, rows downwards
    if texture.filter_type == "nearest":
        return _texel(texture, int(np.floor(x)), int(np.floor(y)))
    x, y = x - 0.5, y - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - left, y - top
    upper, lower = (
        (1 - fx) * _texel(texture, left, row) + fx * _texel(texture, left + 1, row)
        for row in (top, top + 1)
    )
    return (1 - fy) * upper + fy * lower


def _texel(texture: BitmapTexture, column: int, row: int) -> Vector:
    place = []
    for i, size in ((row, texture.pixels.shape[0]), (column, texture.pixels.shape[1])):
        match texture.wrap_mode:
            case "repeat":
                place.append(i % size)
            case "mirror":
                place.append(min(i % (2 * size), -1 - i % (2 * size) + 2 * size))
            case "clamp":
                place.append(min(max(i, 0), size - 1))
    return texture.pixels[place[0], place[1]].astype(np.float64)
