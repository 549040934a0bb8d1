"""Environments: light from infinitely far away, found by rays that hit nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.kernels.jit import interface, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import load3
from renderer.plugins.lights.kind import add_lanes, bsdf_sample_weight, light_probability


@interface
def environment_light(lights: Any, direction: Any, mask: Any) -> Any:
    """Return the radiance that comes from directions, and the density [1/sr] of each.

    `lights` is the table of a kind of which a scene has one at most, the density that
    with which `sample_light` chooses the direction.
    """


@method_kernel
def add_environment(kind, settings, lights, rays, hits, first, count, radiance):
    """Add the environment for the rays that have hit nothing."""
    probability = light_probability(lights, settings) * np.float32(kind.sampled)
    for i in range(first, first + count, 16):
        valid = first_lanes(first + count - i)
        missed = valid & (load_row(hits.prim, 0, i) < 0)
        if mask_bits(missed) == 0:
            continue
        color, light_pdf = environment_light(kind.lights, load3(rays.direction, i), missed)
        pdf = load_row(rays.pdf, 0, i)
        weight = bsdf_sample_weight(settings, pdf, light_pdf * probability)
        carried = load3(rays.throughput, i) * weight * color
        add_lanes(radiance, load_row(rays.slot, 0, i), carried, missed)
