"""Constant environment: the same radiance from every direction."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel, method_kernel
from renderer.kinds.lights.columns import vector_columns
from renderer.kinds.lights.kind import LightPlugin, LightSample, sample_light
from renderer.kinds.lights.weights import add_lanes, bsdf_sample_weight, light_probability
from renderer.kinds.sampling.numbers_and_warps import square_to_sphere
from renderer.lanes.functions import first_lanes, mask_bits, splat_f32
from renderer.lanes.memory import load_row
from renderer.lanes.vectors import column, gather3, load3
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import ConstantLight

SPHERE_PDF = np.float32(1.0 / (4.0 * np.pi))
_FOUR_PI = np.float32(4.0 * np.pi)


class ConstantLights(NamedTuple):
    """The environment; at most one."""

    radiance: NDArray[np.float32]  # (3, n)
    distance: float  # beyond the whole scene


def read(properties: Any) -> ConstantLight:
    """Read the properties of a file."""
    # It looks the same from everywhere; Mitsuba takes and ignores a transform.
    properties.transform("to_world")
    return ConstantLight(read_color(properties, "radiance", 1.0, Use.EMISSION))


def table(count: int, lights: dict[int, ConstantLight], beyond: float) -> ConstantLights:
    """Return the lights as columns."""
    return ConstantLights(
        vector_columns(count, {i: e.radiance for i, e in lights.items()}), beyond
    )


@sample_light.by(ConstantLights)
@kernel
def sample_constant(constants, kind, light, mask, position, x, y, z):
    """Look anywhere, uniformly over the whole sphere, as Mitsuba does it.

    Half the samples of a surface point are below its horizon.
    """
    distance = splat_f32(np.float32(constants.distance))
    radiance = gather3(constants.radiance, light, mask) * _FOUR_PI
    return LightSample(square_to_sphere(x, y), distance, radiance, splat_f32(SPHERE_PDF))


@method_kernel
def add_constant(kind, settings, lights, rays, hits, first, count, radiance):
    """Add the environment for the rays that have hit nothing."""
    index = 0
    while kind.kind[index] != kind.index:
        index += 1
    color = column(kind.lights.radiance, index)
    probability = light_probability(lights, settings)
    for i in range(first, first + count, 16):
        valid = first_lanes(first + count - i)
        missed = valid & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) == 0:
            continue
        pdf = load_row(rays.pdf, 0, i)
        weight = bsdf_sample_weight(settings, pdf, splat_f32(SPHERE_PDF * probability))
        carried = load3(rays.throughput, i) * weight * color
        add_lanes(radiance, load_row(rays.slot, 0, i), carried, missed)


CONSTANT = LightPlugin(
    "constant",
    ConstantLight,
    read,
    table,
    at_infinity=True,
    environment=add_constant,
)
