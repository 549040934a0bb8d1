"""Textures: a colour property that may vary over the surface."""

from __future__ import annotations

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file.colors.colors import Use, read_color, read_constant_plugin
from renderer.scene_file.description import (
    BitmapTexture,
    CheckerboardTexture,
    ConstantTexture,
    Texture,
)
from renderer.scene_file.document.tree import Element
from renderer.scene_file.images.images import read_image
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading

_VARYING = ("bitmap", "checkerboard")


def read_texture(properties: Properties, name: str, default: float) -> Texture:
    """Return the texture of a reflectance property; a plain colour is one too.

    Raises
    ------
    SceneError
        If it is neither, or its image cannot be used.
    """
    property_ = properties.take(name)
    if property_ is not None and isinstance(property_.value, Element):
        element = property_.value
        if element.tag == "texture" and element.plugin in _VARYING:
            reading = properties.reading
            return reading.once(element, lambda: read_texture_plugin(element, reading))
    return ConstantTexture(read_color(properties, name, default, Use.REFLECTANCE))


def read_texture_plugin(element: Element, reading: Reading) -> Texture:
    """Read a `<texture>` element by its plugin.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    match element.plugin:
        case "bitmap":
            return _bitmap(Properties(element, reading))
        case "checkerboard":
            return _checkerboard(Properties(element, reading))
        case _:
            return ConstantTexture(read_constant_plugin(element, reading))


def _bitmap(properties: Properties) -> BitmapTexture:
    if not properties.has("filename"):
        properties.fail("filename", "nothing", "the path of a PNG, JPEG or EXR image")
    filename = properties.string("filename", "")
    location = properties.element.properties["filename"].location
    path = properties.reading.find_file(filename, location, "the image")
    raw = properties.boolean("raw", False)
    storage = properties.choice("format", "auto", ("auto", "variant", "fp16"))
    properties.boolean("accel", True)  # of GPU backends; nothing to accelerate here
    try:
        pixels = read_image(path, raw=raw, storage=storage)
    except SceneError as error:
        raise SceneError(f"{location}: {properties.element}: {error}") from None
    filter_type = properties.choice("filter_type", "bilinear", ("bilinear", "nearest"))
    wrap_mode = properties.choice("wrap_mode", "repeat", ("repeat", "mirror", "clamp"))
    to_uv = properties.uv_transform("to_uv")
    properties.finish()
    if (largest := float(pixels.max())) > 1.0:
        # Mitsuba lets such images through, so they render here; but light is created.
        properties.reading.warn(
            location,
            f"{path.name} has reflectances up to {largest:g}; energy is not conserved",
        )
    return BitmapTexture(
        # Mitsuba has the top row of the file at v = 0; the record has row 0 at v = 1.
        np.ascontiguousarray(pixels[::-1]),
        "nearest" if filter_type == "nearest" else "bilinear",
        "mirror"
        if wrap_mode == "mirror"
        else "clamp"
        if wrap_mode == "clamp"
        else "repeat",
        to_uv,
    )


def _checkerboard(properties: Properties) -> CheckerboardTexture:
    texture = CheckerboardTexture(
        read_color(properties, "color0", 0.4, Use.REFLECTANCE),
        read_color(properties, "color1", 0.2, Use.REFLECTANCE),
        properties.uv_transform("to_uv"),
    )
    properties.finish()
    return texture
