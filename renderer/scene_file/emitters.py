"""Emitters: area lights on shapes, and those that stand alone."""

from __future__ import annotations

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.colors import Use, read_color
from renderer.scene_file.description import (
    ConstantLight,
    DirectionalLight,
    Emitter,
    PointLight,
    Rgb,
    SpotLight,
)
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading
from renderer.scene_file.tree import Element

_STRETCH = 1e-4  # relative difference of two axes that counts as rounding


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
    emitter: Emitter
    match element.plugin:
        case "point":
            emitter = _point(properties)
        case "spot":
            emitter = _spot(properties)
        case "directional":
            emitter = _directional(properties)
        case "constant":
            # It looks the same from everywhere; Mitsuba takes and ignores a transform.
            properties.transform("to_world")
            emitter = ConstantLight(read_color(properties, "radiance", 1.0, Use.EMISSION))
        case _:
            raise SceneError(
                f"{element.location}: {element} belongs inside of a <shape>, whose surface "
                "it makes shine; emitters of the scene: point, spot, directional, constant"
            )
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


def _point(properties: Properties) -> PointLight:
    _one_of(properties, "position")
    if properties.has("position"):
        position = properties.vector("position", (0.0, 0.0, 0.0))
    else:
        x, y, z = (float(value) for value in properties.transform("to_world")[:3, 3])
        position = (x, y, z)
    return PointLight(position, read_color(properties, "intensity", 1.0, Use.EMISSION))


def _spot(properties: Properties) -> SpotLight:
    to_world = properties.transform("to_world")
    lengths = transforms.column_lengths(to_world)
    if transforms.has_shear(to_world) or np.ptp(lengths) > _STRETCH * lengths.max():
        properties.fail(
            "to_world",
            "a transform that distorts the cone",
            "a rotation, translation and uniform scale",
        )
    to_world[:3, :3] /= lengths  # the size of a point means nothing
    cutoff = properties.number("cutoff_angle", 20.0, above=0.0, at_most=180.0)
    beam = properties.number("beam_width", 0.75 * cutoff, at_least=0.0, at_most=cutoff)
    if properties.has("texture"):
        properties.fail(
            "texture", "a projected texture", "none: spots have one colour here"
        )
    intensity = read_color(properties, "intensity", 1.0, Use.EMISSION)
    return SpotLight(to_world, intensity, cutoff, beam)


def _directional(properties: Properties) -> DirectionalLight:
    _one_of(properties, "direction")
    if properties.has("direction"):
        direction = np.array(properties.vector("direction", (0.0, 0.0, 1.0)))
        if not direction.any():
            properties.fail("direction", "the zero vector", "a direction")
        direction /= np.abs(direction).max()  # so that no square under- or overflows
    else:
        to_world = properties.transform("to_world")
        direction = to_world[:3, 2]
        if abs(np.linalg.norm(direction) - 1.0) > _STRETCH:
            # Mitsuba would use the stretched vector as if its length were 1.
            properties.fail("to_world", "a transform that stretches z", "a rotation")
    x, y, z = (float(value) for value in direction / np.linalg.norm(direction))
    return DirectionalLight(
        (x, y, z), read_color(properties, "irradiance", 1.0, Use.EMISSION)
    )


def _one_of(properties: Properties, name: str) -> None:
    if properties.has(name) and properties.has("to_world"):
        properties.fail(name, 'a value beside "to_world"', "one of the two")
