"""Kinds of lights in a scene, for plans and simplifications."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.lights.registry import plugin_of
from renderer.scene.light_order import light_order
from renderer.scene_file.description import (
    EnvironmentMap,
    SceneDescription,
    SpotLight,
)


def has_extended_lights(
    description: SceneDescription, *, but_even_sky: bool = False
) -> bool:
    """Return whether there are lights that a ray can hit: area lights, environments.

    With `but_even_sky` a constant environment does not count.
    """
    emitters = map(plugin_of, description.emitters)
    return any(shape.radiance is not None for shape in description.shapes) or any(
        kind.environment and not (but_even_sky and kind.even) for kind in emitters
    )


def has_even_sky(description: SceneDescription) -> bool:
    """Return whether there is an environment of constant radiance."""
    return any(plugin_of(emitter).even for emitter in description.emitters)


def has_textured_lamps(description: SceneDescription) -> bool:
    """Return whether any area light has a texture as its radiance."""
    lit = (shape.radiance for shape in description.shapes)
    return any(radiance is not None and not isinstance(radiance, tuple) for radiance in lit)


def has_lights_outside_their_samples(description: SceneDescription) -> bool:
    """Return whether a light may emit in directions that light samples never have.

    Samples of a compensated environment omit directions below its mean radiance. Samples
    of a textured area light are points of the texture; if several triangles have the same
    uv, they find only one of them.
    """
    return has_textured_lamps(description) or any(
        isinstance(emitter, EnvironmentMap) and emitter.mis_compensation
        for emitter in description.emitters
    )


def has_textured_lights(description: SceneDescription) -> bool:
    """Return whether any light has a texture; images of environments count."""
    spots = (e for e in description.emitters if isinstance(e, SpotLight))
    return has_textured_lamps(description) or any(spot.texture for spot in spots)


def sampled_lights(description: SceneDescription, finds_sky: bool) -> NDArray[np.int32]:
    """Return the ids of the sampled lights: without an even sky if `finds_sky`."""
    order, emitters = light_order(description), description.emitters
    sampled = {light for light in order.of_shapes if light >= 0} | set(order.of_emitters)
    if finds_sky:
        pairs = zip(order.of_emitters, emitters, strict=True)
        sampled -= {light for light, emitter in pairs if plugin_of(emitter).even}
    return np.array(sorted(sampled), np.int32)
