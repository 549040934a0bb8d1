"""Light ids: in the order of the file, area lights at the place of their shapes.

`scene.emitters()` in Mitsuba has this order if meshes are not merged (`optimize=False`), so
that the same random number selects the same light. Merging moves area lights on meshes to
the end, in an order that depends on a hash.
"""

from __future__ import annotations

from typing import NamedTuple

from renderer.scene_file.description import SceneDescription


class LightOrder(NamedTuple):
    """Light ids of all emitters."""

    of_shapes: list[int]  # by shape of the scene (not of its groups), -1: none
    of_emitters: list[int]


def light_order(description: SceneDescription) -> LightOrder:
    """Return the light ids of a scene, from 0 on."""
    shapes, emitters = description.shapes, description.emitters
    places = description.emitter_places or (len(shapes),) * len(emitters)
    of_shapes: list[int] = []
    of_emitters: list[int] = []
    count = 0
    for index in range(len(shapes) + 1):
        while len(of_emitters) < len(emitters) and places[len(of_emitters)] <= index:
            of_emitters.append(count)
            count += 1
        if index < len(shapes):
            shines = shapes[index].radiance is not None
            of_shapes.append(count if shines else -1)
            count += shines
    return LightOrder(of_shapes, of_emitters)
