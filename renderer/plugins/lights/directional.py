"""Directional light: parallel rays with the same irradiance everywhere."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import splat_f32
from renderer.kernels.lanes.vectors import gather_vectors
from renderer.plugins.lights.kind import (
    STRETCH,
    LightPlugin,
    LightSample,
    SphereAround,
    distance_beyond,
    one_of,
    sample_light,
    vector_columns,
)
from renderer.plugins.lights.light_tree import LightBounds, from_direction
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import DirectionalLight


@table_columns("to_light", "irradiance")
class DirectionalLights(NamedTuple):
    """Columns by light id."""

    to_light: NDArray[np.float32]  # (4, n) unit
    irradiance: NDArray[np.float32]  # (4, n)
    around: SphereAround


def read(properties: Any) -> DirectionalLight:
    """Read the properties of a file."""
    one_of(properties, "direction")
    if properties.has("direction"):
        direction = np.array(properties.vector("direction", (0.0, 0.0, 1.0)))
        if not direction.any():
            properties.fail("direction", "the zero vector", "a direction")
        direction /= np.abs(direction).max()  # squares neither underflow nor overflow
    else:
        to_world = properties.transform("to_world")
        direction = to_world[:3, 2]
        if abs(np.linalg.norm(direction) - 1.0) > STRETCH:
            # Mitsuba would use the stretched vector as if its length were 1.
            properties.fail("to_world", "a transform that stretches z", "a rotation")
    x, y, z = (float(value) for value in direction / np.linalg.norm(direction))
    return DirectionalLight(
        (x, y, z), read_color(properties, "irradiance", 1.0, Use.EMISSION)
    )


def table(
    count: int, lights: dict[int, DirectionalLight], around: SphereAround
) -> DirectionalLights:
    """Return the lights as columns."""
    to_light = {
        i: -np.array(e.direction) / np.linalg.norm(e.direction) for i, e in lights.items()
    }
    irradiance = {i: e.irradiance for i, e in lights.items()}
    return DirectionalLights(
        vector_columns(count, to_light), vector_columns(count, irradiance), around
    )


def bounds(light: DirectionalLight) -> LightBounds:
    """Return the bounds: the irradiance and the direction."""
    return from_direction(float(np.mean(light.irradiance)), -np.array(light.direction))


@sample_light.by(DirectionalLights)
@kernel
def sample_directional(directionals, kind, light, mask, position, x, y, z):
    """Return the direction to the light, and a distance beyond the scene."""
    wi = gather_vectors(directionals.to_light, light, mask)
    irradiance = gather_vectors(directionals.irradiance, light, mask)
    distance = distance_beyond(directionals.around, position)
    return LightSample(wi, distance, irradiance, splat_f32(0.0))


DIRECTIONAL = LightPlugin(
    "directional", DirectionalLight, read, table, bounds, at_infinity=True
)
