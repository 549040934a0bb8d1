"""BSDFs, and those that are inside of others."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.description import Bsdf
from renderer.scene_file.objects.nesting import check_nesting
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

# Each structure is compiled for itself, in time that grows with its depth.
DEEPEST = 8


def read_bsdf(element: Element, reading: Reading) -> Bsdf:
    """Read a `<bsdf>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read(Properties(element, reading)))


def _read(properties: Properties) -> Bsdf:
    plugin = properties.element.plugin
    check_nesting(properties.element, DEEPEST)
    bsdf: Bsdf = registered_kinds("bsdf")[plugin].read(properties)
    properties.finish()
    return bsdf


def read_nested(properties: Properties, least: int, most: int, expected: str) -> list[Bsdf]:
    """Return the BSDFs inside of one, in the order of the file.

    Raises
    ------
    SceneError
        If there are fewer or more than may be; the message says what was expected.
    """
    nested = properties.children("bsdf")
    if not least <= len(nested) <= most:
        raise SceneError(
            f"{properties.location}: {properties.element} holds {len(nested)} bsdfs; "
            f"expected {expected}"
        )
    return [read_bsdf(element, properties.reading) for _, element in nested]
