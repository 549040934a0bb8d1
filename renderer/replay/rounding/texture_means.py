"""Means of bitmaps as Mitsuba adds them up: texel after texel, in single precision.

A sum of millions that is kept in 24 bits drifts: 0.094297 for 0.094341 of a picture of
2048 x 2048 texels, up to 1 % in others. `plastic` and `roughplastic` choose a lobe by such
means, so that all densities of a replay follow. The texels themselves count to the last
bit; with these, the means of all 17 images that were tried agree in all bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from renderer.plugins.textures.kind import LUMINANCE
from renderer.plugins.textures.registry import kind_of_texture, mean_of
from renderer.replay.rounding.arithmetic.fused import Floats, fused_in_numpy
from renderer.scene.materials import MaterialTables, kind_of, value_of
from renderer.scene_file.description import BitmapTexture

_SHARE = "specular_share"  # a parameter of coated BSDFs, which follows from two others
# sRGB to linear above 0.04045 as a quotient of polynomials, off by 1e-7
_ABOVE = (-0.0163933279112946, -0.7386328024653209, -11.199318357635072)
_ABOVE += (-47.46726633009393, -36.04572663838034)
_BELOW = (-0.004261480793199332, -19.140923959601675, -59.096406619244426)
_BELOW += (-18.225745396846637, 1.0)


def rounded_shares(materials: MaterialTables) -> Floats:
    """Return the constant parameters of all BSDFs, with Mitsuba's choices of lobes."""
    values = materials.values()
    for k, bsdf in enumerate(materials.bsdfs):
        rows = {name: first for name, first, _ in kind_of(bsdf).layout()}
        for name, row in rows.items():
            of = name.removesuffix(_SHARE)
            both = f"{of}diffuse_reflectance", f"{of}specular_reflectance"
            if not (name.endswith(_SHARE) and rows.keys() >= set(both)):
                continue
            parts = [value_of(bsdf, part) for part in both]
            # Sums of 10^8 texels may drift by any amount, so no limit would do: a share
            # that does not follow from the exact means is a defect, or something else.
            if np.isclose(values[row, k], _share(mean_of, parts), rtol=1e-6, atol=0.0):
                values[row, k] = _share(rounded_mean, parts)
    return values


def _share(mean: Callable[[Any], float], parts: Sequence[Any]) -> float:
    diffuse, specular = map(mean, parts)
    return specular / (diffuse + specular) if diffuse + specular > 0.0 else math.nan


def rounded_mean(texture: Any) -> float:
    """Return the mean of a texture; only those of bitmaps are rounded in many steps."""
    if not isinstance(texture, BitmapTexture):
        kind = kind_of_texture(texture)
        return float(texture) if kind is None else kind.mean(texture, rounded_mean)
    texels = texture.texels[::-1]  # from the top row of the file
    if texels.dtype == np.uint8:
        decoded = np.arange(256, dtype=np.float32) * np.float32(1.0 / 255.0)
        texels = (_linear(decoded) if texture.srgb else decoded)[texels]
    texels = texels.astype(np.float32, copy=False)
    values = texels[..., 0]
    if texels.shape[2] == 3:
        r, g, b = np.moveaxis(texels, -1, 0)
        values = rounded_luminance(r, g, b)
    return float(np.cumsum(values.ravel(), dtype=np.float32)[-1] / np.float32(values.size))


def rounded_luminance(r: Floats, g: Floats, b: Floats) -> Floats:
    """Return the luminance of linear sRGB, fused as in Mitsuba's wheels."""
    red, green, blue = np.array(LUMINANCE, np.float32)
    return fused_in_numpy(b, blue, fused_in_numpy(r, red, g * green))


def _linear(encoded: Floats) -> Floats:
    above = _polynomial(encoded, _ABOVE) / _polynomial(encoded, _BELOW)
    straight = np.float32(1.0 / 12.92)
    return np.where(encoded > np.float32(0.04045), above, straight) * encoded


def _polynomial(x: Floats, coefficients: tuple[float, ...]) -> Floats:
    """Return c0 + c1 x + c2 x^2 + ..., the terms taken by pairs."""
    terms = [np.full_like(x, c) for c in coefficients]
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        last = terms[-1:] if len(terms) % 2 else []
        terms = [fused_in_numpy(x, high, low) for low, high in pairs] + last
        x = x * x
    return terms[0]
