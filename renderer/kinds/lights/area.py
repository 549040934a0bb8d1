"""Area lights: a point on the shape, chosen by area; on a sphere, by the cone it fills.

From density per area to density per solid angle: pdf = r^2 / (|cos| A). How a point is
chosen is a matter of the shape (`renderer.kinds.shapes`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel, method_kernel
from renderer.kinds.lights.kind import LightSample, sample_light
from renderer.kinds.lights.weights import add_lanes, bsdf_sample_weight, light_probability
from renderer.kinds.sampling.arithmetic import seen_from
from renderer.kinds.shapes.surface import pdf_shape, sample_shape
from renderer.lanes.functions import fabs, first_lanes, mask_bits, select, splat_f32
from renderer.lanes.memory import gather_row, load_row
from renderer.lanes.vectors import dot, gather3, length, load3


class AreaLights(NamedTuple):
    """Area lights on shapes of one kind; columns by light id."""

    radiance: NDArray[np.float32]  # (3, n)
    inverse_area: NDArray[np.float32]  # (n,)
    prim: NDArray[np.int32]  # (n,) primitive id of an analytic shape
    orientation: NDArray[np.float32]  # (n,)
    surfaces: Any  # the record of the shapes
    choice: Any  # of meshes: TriangleLights or another way to choose; else None


@sample_light.by(AreaLights)
@kernel
def sample_area(areas, kind, light, mask, position, x, y, z):
    """Choose a point of each light; it shines on the side of its normal only."""
    prim = gather_row(areas.prim, 0, light, mask)
    chosen = sample_shape(areas.surfaces, kind, light, mask, position, x, y, z)
    r = length(chosen.to_light)
    wi = chosen.to_light / r
    cosine = fabs(dot(wi, chosen.normal))
    pdf = pdf_shape(areas.surfaces, kind, light, prim, mask, position, r, cosine)
    usable = (dot(wi, chosen.side) < 0.0) & (pdf > 0.0)
    inverse = select(usable, 1.0 / pdf, splat_f32(0.0))
    return LightSample(wi, r, gather3(areas.radiance, light, mask) * inverse, pdf)


@method_kernel
def add_emission(kind, settings, lights, shapes, points, count, radiance):
    """Add L_e of the lights of one kind that `count` paths have arrived at."""
    areas = kind.lights
    probability = light_probability(lights, settings)
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        light = gather_row(shapes.light, 0, load_row(points.shape, 0, i), valid)
        lamp = valid & (light >= 0)
        mine = lamp & (gather_row(kind.kind, 0, light, lamp) == kind.index)
        shining = mine & (dot(load3(points.wo, i), load3(points.shading_normal, i)) > 0.0)
        if mask_bits(shining) == 0:
            continue
        previous, distance, cosine = seen_from(kind.arithmetic, points, i)
        prim = load_row(points.prim, 0, i)
        light_pdf = pdf_shape(
            areas.surfaces, kind, light, prim, shining, previous, distance, cosine
        )
        weight = bsdf_sample_weight(
            settings, load_row(points.pdf, 0, i), light_pdf * probability
        )
        emitted = gather3(areas.radiance, light, shining) * weight
        carried = load3(points.throughput, i) * emitted
        add_lanes(radiance, load_row(points.slot, 0, i), carried, shining)
