"""Textures: a parameter that may vary over the surface; what kinds there are, they say."""

from __future__ import annotations

from renderer.scene_file.colors.colors import Use, read_color, read_constant_plugin
from renderer.scene_file.description import ConstantTexture, Texture
from renderer.scene_file.objects.nesting import check_nesting
from renderer.scene_file.plugins import registered_kinds, varying_textures
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

DEEPEST = 12  # textures inside of one another; a checkerboard holds two


def read_texture(
    properties: Properties, name: str, default: float, use: Use = Use.REFLECTANCE
) -> Texture:
    """Return the texture of a colour property; a plain colour is one too.

    Parameters
    ----------
    default
        The grey that an absent property means.
    use
        Decides which plain colours are possible.

    Raises
    ------
    SceneError
        If it is neither, or its image cannot be used.
    """
    texture = _varying(properties, name, use)
    if texture is not None:
        return texture
    return ConstantTexture(read_color(properties, name, default, use))


def read_scalar_texture(
    properties: Properties, name: str, default: float, use: Use = Use.NUMBER
) -> Texture | float:
    """Return the number of a property, or the texture that gives it.

    A colour means the mean of its three numbers, as in Mitsuba.

    Raises
    ------
    SceneError
        As `read_texture`.
    """
    texture = _varying(properties, name, use)
    if texture is not None:
        return texture
    return sum(read_color(properties, name, default, use)) / 3.0


def _varying(properties: Properties, name: str, use: Use) -> Texture | None:
    property_ = properties.take(name)
    element = None if property_ is None else property_.value
    if not isinstance(element, Element) or element.plugin not in varying_textures():
        return None  # the colour of a constant is for `read_color`, which checks it
    return read_texture_plugin(element, properties.reading, use)


def read_texture_plugin(
    element: Element, reading: Reading, use: Use = Use.REFLECTANCE
) -> Texture:
    """Read a `<texture>` by its plugin; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read(Properties(element, reading), use))


def _read(properties: Properties, use: Use) -> Texture:
    element = properties.element
    if element.plugin not in varying_textures():
        return ConstantTexture(read_constant_plugin(element, properties.reading))
    check_nesting(element, DEEPEST)
    texture: Texture = registered_kinds("texture")[element.plugin].read(properties, use)
    properties.finish()
    return texture
