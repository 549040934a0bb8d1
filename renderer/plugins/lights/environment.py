"""Environments: radiance by direction from infinity, found by rays that hit nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits, select, splat_f32
from renderer.kernels.lanes.memory import load_row, store_where
from renderer.kernels.lanes.vectors import column, gather3, load3, select3, vec3
from renderer.plugins.lights.kind import (
    STRETCH,
    LightSample,
    add_lanes,
    bsdf_sample_weight,
    distance_beyond,
    light_probability,
)

# -------------------------------------------------------------------------------- frame
# Code for environments that have a local frame.


def read_rotation(properties: Any) -> NDArray[np.float64]:
    """Return `to_world`, (4, 4), which must be a rotation or a reflection."""
    to_world: NDArray[np.float64] = properties.transform("to_world")
    axes = to_world[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() > STRETCH:
        # Mitsuba would use stretched vectors as if their length were 1.
        properties.fail(
            "to_world", "a transform that stretches directions", "a rotation or a mirroring"
        )
    return to_world


@kernel
def rotated(matrix, d):
    """Return a (3, 3) matrix times directions."""
    return column(matrix, 0) * d.x + column(matrix, 1) * d.y + column(matrix, 2) * d.z


@kernel
def distant_sample(sky, position, wi, radiance, pdf):
    """Return light samples for directions: radiance over pdf [1/sr].

    Where the pdf is NaN or 0 the sample is 0.
    """
    usable = pdf > 0.0
    pdf = select(usable, pdf, splat_f32(0.0))
    radiance = radiance * (1.0 / select(usable, pdf, splat_f32(1.0)))
    black = splat_f32(0.0)
    radiance = select3(usable, radiance, vec3(black, black, black))
    return LightSample(wi, distance_beyond(sky.around, position), radiance, pdf)


# -------------------------------------------------------------------------------- light


@interface
def environment_light(lights: Any, position: Any, direction: Any, mask: Any) -> Any:
    """Return the radiance from directions, and the light-sampling pdf [1/sr] of each.

    `lights` is the table of the environment. The pdf is that of `sample_light` for these
    directions at `position`.
    """


@kernel
def points_left(points, rays, i, mask):
    """Return the origins of rays i to i + 15; 0 where the pdf of the ray is 0.

    Camera rays and delta lobes have pdf 0: light samples never have their directions.
    """
    left = mask & (load_row(rays.pdf, 0, i) > 0.0)
    return gather3(points.position, load_row(rays.point, 0, i), left)


@method_kernel
def add_environment(kind, settings, lights, points, rays, hits, first, count, radiance):
    """Add the environment's radiance for the rays that have hit nothing, with MIS weights.

    `points` are still the points where the rays start.
    """
    probability = light_probability(lights, settings) * np.float32(kind.sampled)
    for i in range(first, first + count, 16):
        valid = first_lanes(first + count - i)
        missed = valid & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) == 0:
            continue
        position, direction = points_left(points, rays, i, missed), load3(rays.direction, i)
        color, light_pdf = environment_light(kind.lights, position, direction, missed)
        pdf = load_row(rays.pdf, 0, i)
        weight = bsdf_sample_weight(settings, pdf, light_pdf * probability)
        carried = load3(rays.throughput, i) * weight * color
        add_lanes(radiance, load_row(rays.slot, 0, i), carried, missed)


@method_kernel
def sky_densities(kind, settings, lights, points, rays, hits, count, density):
    """Store the light-sampling pdf [1/sr] for the rays that hit nothing.

    `points` are the points where the rays start.
    """
    probability = light_probability(lights, settings) * np.float32(kind.sampled)
    for i in range(0, count, 16):
        missed = first_lanes(count - i) & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) != 0:
            position = points_left(points, rays, i, missed)
            direction = load3(rays.direction, i)
            _, pdf = environment_light(kind.lights, position, direction, missed)
            store_where(density, 0, i, pdf * probability, missed)
