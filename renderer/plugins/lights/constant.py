"""Constant environment: the same radiance from every direction."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import splat_f32
from renderer.kernels.lanes.vectors import column
from renderer.plugins.lights.environment import environment_light
from renderer.plugins.lights.kind import (
    LightPlugin,
    LightSample,
    SphereAround,
    distance_beyond,
    sample_light,
    vector_columns,
)
from renderer.plugins.lights.light_tree import LightBounds, from_everywhere
from renderer.plugins.sampling.numbers_and_warps import square_to_sphere
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import ConstantLight

SPHERE_PDF = np.float32(1.0 / (4.0 * np.pi))
_FOUR_PI = np.float32(4.0 * np.pi)


@table_columns("radiance")
class ConstantLights(NamedTuple):
    """The environment; at most one."""

    radiance: NDArray[np.float32]  # (4, 1)
    around: SphereAround


def read(properties: Any) -> ConstantLight:
    """Read the properties of a file."""
    # Invariant under rotations; Mitsuba accepts and ignores a transform.
    properties.transform("to_world")
    return ConstantLight(read_color(properties, "radiance", 1.0, Use.EMISSION))


def table(
    count: int, lights: dict[int, ConstantLight], around: SphereAround
) -> ConstantLights:
    """Return the lights as columns."""
    (sky,) = lights.values()
    return ConstantLights(vector_columns(1, {0: sky.radiance}), around)


def bounds(light: ConstantLight) -> LightBounds:
    """Return the bounds: the same radiance from everywhere."""
    return from_everywhere(float(np.mean(light.radiance)))


@sample_light.by(ConstantLights)
@kernel
def sample_constant(constants, kind, light, mask, position, x, y, z):
    """Sample a direction uniformly over the whole sphere, as in Mitsuba.

    On a surface, half of the samples are below the horizon.
    """
    distance = distance_beyond(constants.around, position)
    radiance = column(constants.radiance, 0) * splat_f32(_FOUR_PI)
    return LightSample(square_to_sphere(x, y), distance, radiance, splat_f32(SPHERE_PDF))


@environment_light.by(ConstantLights)
@kernel
def _constant_light(constants, position, direction, mask):
    return column(constants.radiance, 0), splat_f32(SPHERE_PDF)


CONSTANT = LightPlugin(
    "constant",
    ConstantLight,
    read,
    table,
    bounds,
    at_infinity=True,
    environment=True,
    even=True,
)
