"""BSDFs: those that are registered, and twosided around them."""

from __future__ import annotations

from typing import Any

from renderer.errors import SceneError
from renderer.scene_file.description import Bsdf, TwoSided
from renderer.scene_file.document.tree import Element
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading


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
    bsdf = (
        _two_sided(properties)
        if plugin == "twosided"
        else registered_kinds("bsdf")[plugin].read(properties)
    )
    properties.finish()
    return bsdf


def _two_sided(properties: Properties) -> TwoSided:
    nested = properties.children("bsdf")
    if not 1 <= len(nested) <= 2:
        raise SceneError(
            f"{properties.location}: {properties.element} holds {len(nested)} bsdfs; "
            "expected one for both sides, or one for each"
        )
    sides: list[Any] = []
    kinds = registered_kinds("bsdf")
    possible = [name for name, kind in kinds.items() if not kind.transmits]
    for _, element in nested:
        # before reading it: twosided inside of twosided would recurse
        if element.plugin in ("twosided", *kinds) and element.plugin not in possible:
            raise SceneError(
                f"{element.location}: {element} cannot be inside of twosided; supported: "
                + ", ".join(possible)
            )
        sides.append(read_bsdf(element, properties.reading))
    return TwoSided(front=sides[0], back=sides[-1])
