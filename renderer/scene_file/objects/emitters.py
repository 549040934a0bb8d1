"""Emitters: area lights on shapes, and those that stand alone."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import (
    Emitter,
    Rgb,
)
from renderer.scene_file.document.tree import Element
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading


def read_area_radiance(element: Element, reading: Reading) -> Rgb:
    """Return the radiance of the emitter inside a shape.

    Raises
    ------
    SceneError
        If it is anything but a uniform area light.
    """
    properties = Properties(element, reading)
    if element.plugin != "area":
        raise SceneError(
            f"{element.location}: {element} cannot be in a shape; supported there: area"
        )
    if properties.has("to_world"):
        properties.fail("to_world", "a transform", "none: the light is where its shape is")
    radiance = read_color(properties, "radiance", 1.0, Use.EMISSION)
    _weight(properties)
    properties.finish()
    return radiance


def read_emitter(element: Element, reading: Reading) -> Emitter:
    """Read an `<emitter>` of the scene.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    properties = Properties(element, reading)
    kinds = registered_kinds("emitter")
    kind = kinds.get(element.plugin)
    if kind is None:
        raise SceneError(
            f"{element.location}: {element} belongs inside of a <shape>, whose surface "
            f"it makes shine; emitters of the scene: {', '.join(kinds)}"
        )
    emitter: Emitter = kind.read(properties)
    _weight(properties)
    properties.finish()
    return emitter


def _weight(properties: Properties) -> None:
    """Refuse a sampling weight, which would change how lights are chosen."""
    weight = properties.number("sampling_weight", 1.0)
    if weight != 1.0:
        properties.fail(
            "sampling_weight", f"{weight:g}", "1: lights are chosen with equal probability"
        )
