"""Area lights: points sampled uniformly by area; on a sphere, directions in its cone.

Conversion from area to solid angle: pdf = r^2 / (|cos| A). The shape samples the point
(`renderer.plugins.shapes`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel, method_kernel, table_columns
from renderer.kernels.lanes.functions import fabs, first_lanes, mask_bits, select, splat_f32
from renderer.kernels.lanes.memory import gather_row, load_row, store_where
from renderer.kernels.lanes.vectors import dot, gather_vectors, length, load3
from renderer.plugins.lights.kind import (
    LightPlugin,
    LightSample,
    add_lanes,
    bsdf_sample_weight,
    light_probability,
    sample_light,
)
from renderer.plugins.lights.texel_choice import texel_luminance
from renderer.plugins.lights.textures import refuse_nested
from renderer.plugins.sampling.numbers_and_warps import seen_from
from renderer.plugins.shapes.surface import pdf_shape, sample_shape
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import (
    AreaLight,
    BitmapTexture,
    CheckerboardTexture,
    ConstantTexture,
)
from renderer.scene_file.objects.objects import read_texture


@table_columns("radiance")
class AreaLights(NamedTuple):
    """Area lights on shapes of one kind; columns by light id."""

    radiance: NDArray[np.float32]  # (4, n)
    inverse_area: NDArray[np.float32]  # (n,)
    prim: NDArray[np.int32]  # (n,) primitive id of an analytic shape
    orientation: NDArray[np.float32]  # (n,)
    surfaces: Any  # the record of the shapes
    choice: Any  # for meshes, how a triangle is sampled (`TriangleLights`); else None


@sample_light.by(AreaLights)
@kernel
def sample_area(areas, kind, light, mask, position, x, y, z):
    """Sample a point of each light; lights emit only on the side of their normal."""
    prim = gather_row(areas.prim, 0, light, mask)
    chosen = sample_shape(areas.surfaces, kind, light, mask, position, x, y, z)
    r = length(chosen.to_light)
    wi = chosen.to_light / r
    cosine = fabs(dot(wi, chosen.normal))
    pdf = pdf_shape(areas.surfaces, kind, light, prim, mask, position, r, cosine)
    usable = (dot(wi, chosen.side) < 0.0) & (pdf > 0.0)
    inverse = select(usable, 1.0 / pdf, splat_f32(0.0))
    return LightSample(wi, r, gather_vectors(areas.radiance, light, mask) * inverse, pdf)


@interface
def emitted_light(
    lights: Any, kind: Any, points: Any, i: int, light: Any, mask: Any
) -> Any:
    """Return the emitted radiance of lights at points i to i + 15, and the pdf.

    The pdf [1/sr] is that of `sample_light` for this direction at the previous path vertex.
    `lights` is the table of a kind of light that lies on shapes.
    """


@emitted_light.by(AreaLights)
@kernel
def _emitted(areas, kind, points, i, light, mask):
    previous, distance, cosine = seen_from(kind.arithmetic, points, i)
    prim = load_row(points.prim, 0, i)
    pdf = pdf_shape(areas.surfaces, kind, light, prim, mask, previous, distance, cosine)
    return gather_vectors(areas.radiance, light, mask), pdf


@kernel
def shining_lights(kind, shapes, points, i, count):
    """Return the lights of points i to i + 15, and the mask of emitting ones of a kind."""
    valid = first_lanes(count - i)
    light = gather_row(shapes.light, 0, load_row(points.shape, 0, i), valid)
    lamp = valid & (light >= 0)
    mine = lamp & (gather_row(kind.kind, 0, light, lamp) == kind.index)
    return light, mine & (dot(load3(points.wo, i), load3(points.shading_normal, i)) > 0.0)


@method_kernel
def lamp_densities(kind, settings, lights, shapes, points, count, density):
    """Store the light-sampling pdf [1/sr] of the directions that hit `count` points."""
    probability = light_probability(lights, settings)
    for i in range(0, count, 16):
        light, shining = shining_lights(kind, shapes, points, i, count)
        if mask_bits(shining) != 0:
            _, pdf = emitted_light(kind.lights, kind, points, i, light, shining)
            store_where(density, 1, i, pdf * probability, shining)


@method_kernel
def add_emission(kind, settings, lights, shapes, points, count, radiance):
    """Add L_e of the lights of one kind that `count` rays have hit, with MIS weights."""
    probability = light_probability(lights, settings)
    for i in range(0, count, 16):
        light, shining = shining_lights(kind, shapes, points, i, count)
        if mask_bits(shining) == 0:
            continue
        color, light_pdf = emitted_light(kind.lights, kind, points, i, light, shining)
        weight = bsdf_sample_weight(
            settings, load_row(points.pdf, 0, i), light_pdf * probability
        )
        carried = load3(points.throughput, i) * (color * weight)
        add_lanes(radiance, load_row(points.slot, 0, i), carried, shining)


def read(properties: Any) -> AreaLight:
    """Read the properties of a file."""
    if properties.has("to_world"):
        properties.fail("to_world", "a transform", "none: the light is where its shape is")
    radiance = read_texture(properties, "radiance", 1.0, Use.EMISSION)
    if isinstance(radiance, ConstantTexture):
        return AreaLight(radiance.rgb)
    if not isinstance(radiance, BitmapTexture | CheckerboardTexture):
        properties.fail(
            "radiance", "a texture that Mitsuba cannot sample", "a bitmap or checkerboard"
        )
    refuse_nested(properties, "radiance", radiance)
    if isinstance(radiance, BitmapTexture) and not texel_luminance(radiance).any():
        properties.fail("radiance", "a black bitmap", "one that shines")
    return AreaLight(radiance)


AREA = LightPlugin("area", AreaLight, read, on_shapes=True)
