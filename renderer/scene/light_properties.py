"""Properties of lights that the choice among them needs, and their order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.lights.registry import plugin_of
from renderer.scene_file.description import (
    EnvironmentMap,
    SceneDescription,
    SpotLight,
)

# -------------------------------------------------------------------------- light order
# The numbers of the lights: their order in the file, area lights at their shapes.
#
# It is the order of `scene.emitters()` in Mitsuba where meshes are not merged
# (`optimize=False`), so that the same random number chooses the same light. Merging moves
# area lights on meshes to the end, in an order that depends on a hash.


class LightOrder(NamedTuple):
    """Light ids of everything that shines."""

    of_shapes: list[int]  # by shape of the scene (not of its groups), -1: none
    of_emitters: list[int]


def light_order(description: SceneDescription) -> LightOrder:
    """Return the numbers of the lights of a scene, from 0 on."""
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


# --------------------------------------------------------------------- light properties
# Which kinds of lights a scene has: used by plans and simplifications.


def has_extended_lights(
    description: SceneDescription, *, but_even_sky: bool = False
) -> bool:
    """Return whether there are lights that a ray can meet: shapes, environments.

    Without the even sky, if it is to be left out.
    """
    emitters = map(plugin_of, description.emitters)
    return any(shape.radiance is not None for shape in description.shapes) or any(
        kind.environment and not (but_even_sky and kind.even) for kind in emitters
    )


def has_even_sky(description: SceneDescription) -> bool:
    """Return whether there is an environment of one radiance from everywhere."""
    return any(plugin_of(emitter).even for emitter in description.emitters)


def has_textured_lamps(description: SceneDescription) -> bool:
    """Return whether the radiance of a shape depends on where it is met."""
    lit = (shape.radiance for shape in description.shapes)
    return any(radiance is not None and not isinstance(radiance, tuple) for radiance in lit)


def has_lights_beside_their_samples(description: SceneDescription) -> bool:
    """Return whether a light may emit in directions that light samples never choose.

    Samples of a compensated environment leave out directions below its mean. Samples of a
    textured lamp are points of the texture, and find one of several triangles at the same
    uv.
    """
    return has_textured_lamps(description) or any(
        isinstance(emitter, EnvironmentMap) and emitter.mis_compensation
        for emitter in description.emitters
    )


def has_textured_lights(description: SceneDescription) -> bool:
    """Return whether a texture is looked up in any light; environments have images."""
    spots = (e for e in description.emitters if isinstance(e, SpotLight))
    return has_textured_lamps(description) or any(spot.texture for spot in spots)


def asked_lights(description: SceneDescription, finds_sky: bool) -> NDArray[np.int32]:
    """Return the numbers of the lights that are sampled: all, or all but an even sky."""
    order, emitters = light_order(description), description.emitters
    asked = {light for light in order.of_shapes if light >= 0} | set(order.of_emitters)
    if finds_sky:
        pairs = zip(order.of_emitters, emitters, strict=True)
        asked -= {light for light, emitter in pairs if plugin_of(emitter).even}
    return np.array(sorted(asked), np.int32)
