"""Pictures that textures and lights are made of: a file, or pixels in a dictionary."""

from __future__ import annotations

from pathlib import Path

from renderer.errors import SceneError
from renderer.scene_file.description import Location
from renderer.scene_file.images.image import Image, checked
from renderer.scene_file.images.images import READ_FROM, read_texels
from renderer.scene_file.properties import Properties


def read_picture(properties: Properties, inline: tuple[str, ...]) -> tuple[Image, str, str]:
    """Return a picture, its name for messages, and the property that it comes from.

    What the file says about its numbers and is not applied becomes warnings.

    Parameters
    ----------
    inline
        Properties other than "filename" that may hold the pixels.

    Raises
    ------
    SceneError
        If no picture is given, or it cannot be used.
    """
    there = [key for key in inline if key in properties.element.properties]
    if properties.has("filename") or not there:
        expected = f"the path of an image: {READ_FROM}"
        image, name = properties.file("the image", expected, _texels_and_name)
        for note in image.notes:
            properties.reading.warn(location_of(properties, "filename"), f"{name}: {note}")
        return image, name, "filename"
    key = there[0]
    property_ = properties.take(key)
    given = None if property_ is None else property_.value
    if not isinstance(given, Image):
        properties.fail(key, "no image", "an array of (height, width, channels)")
    try:
        return checked(given, key), key, key
    except SceneError as error:
        raise SceneError(f"{properties.location}: {properties.element}: {error}") from None


def location_of(properties: Properties, key: str) -> Location:
    """Return where a property stands that the element has."""
    return properties.element.properties[key].location


def _texels_and_name(path: Path) -> tuple[Image, str]:
    return read_texels(path), path.name
