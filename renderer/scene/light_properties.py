"""Which kinds of lights a scene has: used by plans and simplifications."""

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


def has_lights_outside_their_samples(description: SceneDescription) -> bool:
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


def sampled_lights(description: SceneDescription, finds_sky: bool) -> NDArray[np.int32]:
    """Return the numbers of the lights that are sampled: all, or all but an even sky."""
    order, emitters = light_order(description), description.emitters
    sampled = {light for light in order.of_shapes if light >= 0} | set(order.of_emitters)
    if finds_sky:
        pairs = zip(order.of_emitters, emitters, strict=True)
        sampled -= {light for light, emitter in pairs if plugin_of(emitter).even}
    return np.array(sorted(sampled), np.int32)
