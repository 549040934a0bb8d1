"""Textures as their mean, or with every colour changed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import (
    BitmapTexture,
    CheckerboardTexture,
    ConstantTexture,
    MeshAttributeTexture,
    Rgb,
    Texture,
)

Colors = NDArray[np.float64]  # (..., 3)


def mean_texture(texture: Any) -> Any:
    """Return a texture's mean over u and v; what has none comes back as it is.

    A mesh attribute has no uv: it stays. So do numbers and constants.
    """
    mean = _mean(texture)
    return texture if mean is None else ConstantTexture(mean)


def mean_radiance(radiance: Any) -> Any:
    """Return the mean of a radiance."""
    mean = _mean(radiance)
    return radiance if mean is None else mean


def _mean(texture: Any) -> Rgb | None:
    if isinstance(texture, BitmapTexture):
        red, green, blue = texture.pixels.mean(axis=(0, 1), dtype=np.float64).tolist()
        return red, green, blue
    if isinstance(texture, CheckerboardTexture):
        colors = [mean_texture(part) for part in (texture.color0, texture.color1)]
        if all(isinstance(color, ConstantTexture) for color in colors):
            red, green, blue = np.mean([color.rgb for color in colors], axis=0).tolist()
            return red, green, blue
    return None


def recolored(texture: Texture, change: Callable[[Colors], Colors]) -> Texture:
    """Return a texture whose colours went through a function; a mesh attribute's do not."""
    if isinstance(texture, ConstantTexture):
        red, green, blue = change(np.array(texture.rgb, np.float64)).tolist()
        return ConstantTexture((red, green, blue))
    if isinstance(texture, BitmapTexture):
        texels = change(texture.pixels.astype(np.float64)).astype(np.float32)
        return dataclasses.replace(texture, texels=texels, srgb=False)
    if isinstance(texture, CheckerboardTexture):
        return dataclasses.replace(
            texture,
            color0=recolored(texture.color0, change),
            color1=recolored(texture.color1, change),
        )
    assert isinstance(texture, MeshAttributeTexture)
    one = float(change(np.ones(3)).mean())
    return dataclasses.replace(texture, scale=texture.scale * one)
