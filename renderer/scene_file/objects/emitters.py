"""Emitters: those of the scene, and those inside of shapes, most of which make them shine.

Mitsuba takes any emitter in a shape: one that is no `area` is where its own properties put
it, and lights the scene as if it stood there; of the shape it makes the default BSDF black.
"""

from __future__ import annotations

from typing import Any

from renderer.errors import SceneError
from renderer.scene_file.coordinate_limits import check_place
from renderer.scene_file.description import Emitter, Radiance
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element


def read_radiance(shape: Element, element: Element, reading: Reading) -> Radiance | None:
    """Return with what radiance the emitter inside a shape makes it shine, None if not.

    Raises
    ------
    SceneError
        If it cannot be in a shape, or is in another one too.
    """
    owner = reading.owners.setdefault(id(element), shape)
    if owner is not shape:
        raise SceneError(
            f"{shape.location}: {element} of line {element.location.line} is that of the "
            f"shape of line {owner.location.line} already; expected one of its own"
        )
    described = reading.once(element, lambda: _read(element, reading))
    kind = registered_kinds("emitter")[element.plugin]
    if kind.environment:
        raise SceneError(
            f"{element.location}: {element} cannot be in a shape: it is an environment of "
            "the scene"
        )
    radiance: Radiance | None = described.radiance if kind.on_shapes else None
    return radiance


def read_emitter(element: Element, reading: Reading) -> Emitter | None:
    """Read an `<emitter>` of the scene; None for one that shapes refer to.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    described: Emitter = reading.once(element, lambda: _read(element, reading))
    if not registered_kinds("emitter")[element.plugin].on_shapes:
        return described
    if not element.id:
        raise SceneError(
            f"{element.location}: {element} belongs inside of a <shape>, whose surface "
            "it makes shine, or has an id for shapes to refer to"
        )
    return None


def _read(element: Element, reading: Reading) -> Any:
    properties = Properties(element, reading)
    described = registered_kinds("emitter")[element.plugin].read(properties)
    weight = properties.number("sampling_weight", 1.0)
    if weight != 1.0:  # it would change how lights are chosen
        properties.fail(
            "sampling_weight", f"{weight:g}", "1: lights are chosen with equal probability"
        )
    properties.finish()
    check_place(described, properties)
    return described
