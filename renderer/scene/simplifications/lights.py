"""The lights of a scene by name, and the scene without one of them."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Collection

from renderer.plugins.lights.registry import plugin_of
from renderer.scene_file.description import SceneDescription

Light = tuple[str, int]  # the field of the description, and the index in it


def lights_by_name(description: SceneDescription) -> dict[str, Light]:
    """Return every light, in the order of the file.

    A shape that shines has its id, or its class and line; any other light its plugin and
    how many of the kind there were so far: `point-1`.
    """
    lights: dict[str, Light] = {}
    shapes = shape_names(description)
    for index, shape in enumerate(description.shapes):
        if shape.radiance is not None:
            lights[shapes[index]] = "shapes", index
    names = description.emitter_names or _counted(description)
    for index, name in enumerate(names):
        lights[_unused(name, {*shapes, *lights})] = "emitters", index
    return lights


def _counted(description: SceneDescription) -> tuple[str, ...]:
    count: Counter[str] = Counter()
    names = []
    for emitter in description.emitters:
        plugin = plugin_of(emitter).name
        count[plugin] += 1
        names.append(f"{plugin}-{count[plugin]}")
    return tuple(names)


def shape_names(description: SceneDescription) -> list[str]:
    """Return the names of every shape: its id, or its class and line.

    Shapes that emit no light have names too, so that leaving out a light renames no other
    shape.
    """
    names: dict[str, None] = {}
    met: Counter[str] = Counter()  # a thousand shapes may stand on one line
    for index, shape in enumerate(description.every_shape):
        place = shape.location.line or index + 1  # a dictionary has no lines
        name = shape.id or f"{type(shape).__name__.lower()}:{place}"
        names[_unused(name + met[name] * "'", names)] = None
        met[name] += 1
    return list(names)


def _unused(name: str, taken: Collection[str]) -> str:
    """Return the name, longer if it is taken: two shapes may stand on one line."""
    while name in taken:
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
