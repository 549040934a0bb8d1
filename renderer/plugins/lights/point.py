"""Point light: E = I / r^2 across the direction to it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import splat_f32
from renderer.kernels.lanes.vectors import dot, gather_vectors, length
from renderer.plugins.lights.kind import (
    LightPlugin,
    LightSample,
    SphereAround,
    one_of,
    sample_light,
    vector_columns,
)
from renderer.plugins.lights.light_tree import LightBounds, all_around
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import PointLight


@table_columns("position", "intensity")
class PointLights(NamedTuple):
    """Columns by light id (those of other kinds are unused)."""

    position: NDArray[np.float32]  # (4, n)
    intensity: NDArray[np.float32]  # (4, n)


def read(properties: Any) -> PointLight:
    """Read the properties of a file."""
    one_of(properties, "position")
    if properties.has("position"):
        position = properties.vector("position", (0.0, 0.0, 0.0))
    else:
        x, y, z = (float(value) for value in properties.transform("to_world")[:3, 3])
        position = (x, y, z)
    return PointLight(position, read_color(properties, "intensity", 1.0, Use.EMISSION))


def table(count: int, lights: dict[int, PointLight], around: SphereAround) -> PointLights:
    """Return the lights as columns."""
    return PointLights(
        vector_columns(count, {i: e.position for i, e in lights.items()}),
        vector_columns(count, {i: e.intensity for i, e in lights.items()}),
    )


def bounds(light: PointLight) -> LightBounds:
    """Return the bounds for importance sampling."""
    return all_around(light.position, float(np.mean(light.intensity)))


@sample_light.by(PointLights)
@kernel
def sample_point(points, kind, light, mask, position, x, y, z):
    """Return the direction to the light, and its radiance."""
    to_light = gather_vectors(points.position, light, mask) - position
    r = length(to_light)
    radiance = gather_vectors(points.intensity, light, mask) / dot(to_light, to_light)
    return LightSample(to_light / r, r, radiance, splat_f32(0.0))


POINT = LightPlugin("point", PointLight, read, table, bounds)
