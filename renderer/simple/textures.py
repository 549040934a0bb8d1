"""Textures: a colour, a number or a gradient for each (u, v)."""

from __future__ import annotations

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file.description import (
    BitmapTexture,
    CheckerboardTexture,
    ConstantTexture,
    MeshAttributeTexture,
    Texture,
    VolumeTexture,
)
from renderer.simple.camera import Vector

# luminance of linear sRGB
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])


def eval_texture(texture: Texture, u: float, v: float) -> Vector:
    """Return the colour at (u, v)."""
    match texture:
        case ConstantTexture():
            return np.array(texture.rgb)
        case CheckerboardTexture():
            same = _in_same_half(texture, u, v)
            return eval_texture(texture.color0 if same else texture.color1, u, v)
        case BitmapTexture():
            texels, fx, fy = _texels(texture, u, v)
            upper, lower = (1.0 - fx) * texels[:, 0] + fx * texels[:, 1]
            color: Vector = (1.0 - fy) * upper + fy * lower
            return color
        case MeshAttributeTexture() | VolumeTexture():
            raise SceneError(
                f"{texture.location}: the simple path tracer has no textures of mesh "
                "attributes and volumes"
            )


def eval_number(texture: Texture | float, u: float, v: float) -> float:
    """Return a texture as one number, for a roughness or an opacity.

    That is the luminance of an image, but the mean of the components of a plain colour. For
    a checkerboard Mitsuba swaps the two colours here.
    """
    match texture:
        case CheckerboardTexture():
            same = _in_same_half(texture, u, v)
            return eval_number(texture.color1 if same else texture.color0, u, v)
        case BitmapTexture():
            return float(eval_texture(texture, u, v) @ LUMINANCE)
        case ConstantTexture():
            return float(np.mean(texture.rgb))
        case float() | int():
            return float(texture)
    return float(eval_texture(texture, u, v)[0])


def eval_slope(texture: Texture, u: float, v: float) -> tuple[float, float]:
    """Return the derivatives of a texture's number by u and v.

    An image is bilinear between its texels. As in Mitsuba, `to_uv` is applied before the
    size of the image. So if `to_uv` rotates an image that is not square, the gradient is
    not exactly that of the visible texture.
    """
    if not isinstance(texture, BitmapTexture) or texture.filter_type == "nearest":
        return 0.0, 0.0  # piecewise constant
    texels, fx, fy = _texels(texture, u, v)
    (a, b), (c, d) = texels @ LUMINANCE
    by_column = (1.0 - fy) * (b - a) + fy * (d - c)
    by_row = (1.0 - fx) * (c - a) + fx * (d - b)
    by_u, by_v = texture.to_uv[:2, :2].T @ (by_column, -by_row)  # v is upwards
    height, width, _ = texture.pixels.shape
    return float(by_u * width), float(by_v * height)


def _in_same_half(board: CheckerboardTexture, u: float, v: float) -> bool:
    """Return whether u and v are both in the lower or both in the upper half of a tile."""
    s, t, _ = board.to_uv @ (u, v, 1.0)
    return bool((s % 1.0 > 0.5) == (t % 1.0 > 0.5))


def _texels(texture: BitmapTexture, u: float, v: float) -> tuple[Vector, float, float]:
    """Return the four texels around a point, (2, 2, 3), and the fractions between them.

    With the filter "nearest" only the first of them is used.
    """
    s, t, _ = texture.to_uv @ (u, v, 1.0)
    height, width, _ = texture.pixels.shape
    x, y = s * width, (1.0 - t) * height  # v is upwards, rows are downwards
    if texture.filter_type != "nearest":
        x, y = x - 0.5, y - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    if texture.filter_type == "nearest":  # on an edge, the texel in the direction of v
        top = height - 1 - int(np.floor(t * height))
    rows = [_wrapped(texture, i, height) for i in (top, top + 1)]
    columns = [_wrapped(texture, i, width) for i in (left, left + 1)]
    texels = texture.pixels[np.ix_(rows, columns)].astype(np.float64)
    if texture.filter_type == "nearest":
        return texels, 0.0, 0.0
    return texels, x - left, y - top


def _wrapped(texture: BitmapTexture, i: int, size: int) -> int:
    """Return the row or column of the image for an index i outside of it."""
    match texture.wrap_mode:
        case "repeat":
            return i % size
        case "mirror":
            return min(i % (2 * size), -1 - i % (2 * size) + 2 * size)
        case _:
            return min(max(i, 0), size - 1)
