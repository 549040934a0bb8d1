"""Simpler materials and textures of a description."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.registry import nested_names
from renderer.scene_file.description import (
    BitmapTexture,
    BumpMap,
    CheckerboardTexture,
    Conductor,
    ConstantTexture,
    Dielectric,
    Diffuse,
    MeshAttributeTexture,
    NormalMap,
    Null,
    OtherBsdf,
    Rgb,
    Texture,
    ThinDielectric,
    VolumeTexture,
)

# ----------------------------------------------------------------------------- textures
# Textures replaced by their mean, or with other colours.

Colors = NDArray[np.float64]  # (..., 3)


def mean_texture(texture: Any) -> Any:
    """Return a texture's mean over uv, or the object itself if it has none.

    A mesh attribute has no mean. Numbers and constants are unchanged too.
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
    """Return a texture with `change` applied to its colours, except a mesh attribute."""
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
    if isinstance(texture, VolumeTexture):
        values = np.broadcast_to(
            texture.volume.values, (*texture.volume.values.shape[:3], 3)
        )
        colors = change(values.astype(np.float64)).astype(np.float32)
        volume = dataclasses.replace(texture.volume, values=colors)
        return dataclasses.replace(texture, volume=volume)
    assert isinstance(texture, MeshAttributeTexture)
    one = float(change(np.ones(3)).mean())
    return dataclasses.replace(texture, scale=texture.scale * one)


# ---------------------------------------------------------------------------- materials
# BSDFs without some part.
#
# A BSDF that does not have the part is returned as the same object, which shows that
# nothing changes and nothing must be rebuilt.

Change = Callable[[Any], Any]

BLACK = ConstantTexture((0.0, 0.0, 0.0))
# Textured parameters that are not colours: their mean would describe another surface.
SURFACE = {"normalmap", "height"}


def everywhere(change: Change) -> Change:
    """Return a change that is applied to nested BSDFs first, and once to each BSDF."""
    done: dict[int, tuple[Any, Any]] = {}  # keeps the old BSDF, or its id() would be reused

    def changed(bsdf: Any) -> Any:
        if id(bsdf) not in done:
            parts = {name: getattr(bsdf, name) for name in nested_names(bsdf)}
            done[id(bsdf)] = bsdf, change(_replaced(bsdf, parts, changed))
        return done[id(bsdf)][1]

    return changed


def _replaced(bsdf: Any, parts: dict[str, Any], change: Change) -> Any:
    """Return a BSDF with its nested ones changed; the same object if none changed."""
    new = {name: change(part) for name, part in parts.items()}
    if all(new[name] is part for name, part in parts.items()):
        return bsdf
    if isinstance(bsdf, OtherBsdf):
        return OtherBsdf(bsdf.plugin, {**bsdf.values, **new})
    return dataclasses.replace(bsdf, **new)


def without_texture(bsdf: Any) -> Any:
    """Replace every texture of a colour or a number by its mean."""
    if isinstance(bsdf, OtherBsdf):
        return _replaced(bsdf, dict(bsdf.values), mean_texture)
    nested = nested_names(bsdf)
    names = [field.name for field in dataclasses.fields(bsdf)]
    parts = {n: getattr(bsdf, n) for n in names if n not in nested and n not in SURFACE}
    return _replaced(bsdf, parts, mean_texture)


def without_relief(bsdf: Any) -> Any:
    """Remove a normal map or a bump map."""
    return bsdf.nested if isinstance(bsdf, NormalMap | BumpMap) else bsdf


def glass_as_nothing(bsdf: Any) -> Any:
    """Replace glass by a null BSDF."""
    glass = isinstance(bsdf, Dielectric | ThinDielectric)
    return Null() if glass or bsdf.plugin == "roughdielectric" else bsdf


def without_specular(bsdf: Any) -> Any:
    """Replace a coated or principled BSDF by its diffuse base.

    The base keeps the albedo that it has under the coat, with the transmittance averaged
    over directions. For a smooth coat that is eta^2 (1 - G) by reciprocity [Walter2007,
    section 4], where G is its mean internal reflectance. For a rough coat a table is used:
    it lacks light that facets reflect to each other, and reciprocity would give up to a
    sixth more.
    """
    if bsdf.plugin == "principled":
        return Diffuse(bsdf.base_color)
    if bsdf.plugin not in ("plastic", "roughplastic"):
        return bsdf
    thrown_back, eta = float(bsdf.thrown_back), float(bsdf.eta)
    passes = eta**2 * (1.0 - thrown_back)
    if bsdf.plugin == "roughplastic":
        table = np.asarray(bsdf.transmittance, np.float64)
        cosines = np.linspace(0.0, 1.0, table.size)
        passes = 2.0 * float(np.trapezoid(cosines * table, cosines))

    def albedo(base: Colors) -> Colors:
        again = base if bsdf.nonlinear else np.ones(3)
        return (passes / eta) ** 2 * base / (1.0 - again * thrown_back)

    return Diffuse(recolored(bsdf.diffuse_reflectance, albedo))


def without_diffuse(bsdf: Any) -> Any:
    """Make the base under a coat black; all samples then go to the coat.

    The base colour of a principled BSDF also affects metallic reflection, tint and
    transmission: with any of these it is unchanged.
    """
    black: dict[str, Any]
    if bsdf.plugin in ("plastic", "roughplastic"):
        base = bsdf.diffuse_reflectance
        black = {"diffuse_reflectance": BLACK, "specular_share": 1.0}
    elif (
        bsdf.plugin == "principled"
        and _is_zero(bsdf.metallic, bsdf.spec_tint)
        and bsdf.main_specular_sampling_rate > 0.0  # otherwise no lobe would be sampled
    ):
        base = bsdf.base_color
        black = {
            "base_color": BLACK,
            "sheen": 0.0,
            "diffuse_reflectance_sampling_rate": 0.0,
        }
    else:
        return bsdf
    return bsdf if base == BLACK else OtherBsdf(bsdf.plugin, {**bsdf.values, **black})


def _is_zero(*parameters: Any) -> bool:
    """Return whether numbers, or textures of one, are 0."""
    zeros = (0.0, BLACK)
    return all(isinstance(p, float | ConstantTexture) and p in zeros for p in parameters)


def metal_as_diffuse(bsdf: Any) -> Any:
    """Replace a metal by a diffuse BSDF with its reflectance at normal incidence."""
    if not (isinstance(bsdf, Conductor) or bsdf.plugin == "roughconductor"):
        return bsdf
    eta, k = (_color(getattr(bsdf, name)) for name in ("eta", "k"))
    reflected = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)

    def tinted(tint: Colors) -> Colors:
        return tint * reflected

    return Diffuse(recolored(bsdf.specular_reflectance, tinted))


def _color(texture: Any) -> Colors:
    mean = mean_texture(texture)
    value: Rgb | float = mean.rgb if isinstance(mean, ConstantTexture) else 1.0
    return np.broadcast_to(np.asarray(value, np.float64), 3)
