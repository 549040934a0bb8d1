"""The lights of a scene by name, and the scene without one of them."""

from __future__ import annotations

import dataclasses
from collections import Counter

from renderer.kinds.lights.registry import plugin_of
from renderer.scene_file.description import SceneDescription, Shape

Light = tuple[str, int]  # the field of the description, and the index in it


def lights_by_name(description: SceneDescription) -> dict[str, Light]:
    """Return every light, in the order of the file.

    A shape that shines has its id, or its class and line; any other light its plugin and
    how many of the kind there were so far: `point-1`.
    """
    lights: dict[str, Light] = {}
    for index, shape in enumerate(description.shapes):
        if shape.radiance is not None:
            lights[_unused(_shape_name(shape, index), lights)] = "shapes", index
    names = description.emitter_names or _counted(description)
    for index, name in enumerate(names):
        lights[_unused(name, lights)] = "emitters", index
    return lights


def _counted(description: SceneDescription) -> tuple[str, ...]:
    count: Counter[str] = Counter()
    names = []
    for emitter in description.emitters:
        plugin = plugin_of(emitter).name
        count[plugin] += 1
        names.append(f"{plugin}-{count[plugin]}")
    return tuple(names)


def _shape_name(shape: Shape, index: int) -> str:
    place = shape.location.line or index + 1  # a dictionary has no lines
    return shape.id or f"{type(shape).__name__.lower()}:{place}"


def _unused(name: str, lights: dict[str, Light]) -> str:
    """Return the name, longer if a light has it: two shapes may stand on one line."""
    while name in lights:
        name += "'"
    return name


def without_light(description: SceneDescription, light: Light) -> SceneDescription:
    """Return the scene without a light; a shape that shone stays, dark."""
    field, gone = light
    if field == "shapes":
        shapes = list(description.shapes)
        shapes[gone] = dataclasses.replace(shapes[gone], radiance=None)
        return dataclasses.replace(description, shapes=tuple(shapes))
    kept = [index for index in range(len(description.emitters)) if index != gone]
    places = description.emitter_places
    names = description.emitter_names or _counted(description)
    return dataclasses.replace(
        description,
        emitters=tuple(description.emitters[index] for index in kept),
        emitter_places=tuple(places[index] for index in kept) if places else (),
        emitter_names=tuple(names[index] for index in kept),
    )
