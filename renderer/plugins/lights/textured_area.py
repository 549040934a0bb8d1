"""Area lights with textured radiance: points are sampled by the texels' luminance.

A sampled (u, v) is mapped to the shape: pdf = pdf_uv r^2 / (|dp/du x dp/dv| cos).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.memory import gather_row, load_row
from renderer.kernels.lanes.vectors import dot, length, load3
from renderer.plugins.lights.area import emitted_light
from renderer.plugins.lights.kind import LightSample, sample_light
from renderer.plugins.lights.texel_choice import choose_uv, uv_density
from renderer.plugins.lights.textures import LightTextures, light_color
from renderer.plugins.sampling.numbers_and_warps import seen_from
from renderer.plugins.shapes.surface import point_at_uv


class TexturedAreas(NamedTuple):
    """Area lights on one kind of shape, with one kind of texture; columns by light id."""

    textures: LightTextures
    choice: Any  # sampling of (u, v): TexelChoice or AnyUv
    prim: NDArray[np.int32]  # (n,) primitive id of an analytic shape
    orientation: NDArray[np.float32]  # (n,)
    surfaces: Any  # the record of the shapes
    chart: Any  # for meshes, UvChart; else None


@kernel
def _at_uv(areas, light, u, v, mask):
    prim = gather_row(areas.prim, 0, light, mask)
    orientation = gather_row(areas.orientation, 0, light, mask)
    return point_at_uv(areas.surfaces, areas.chart, light, prim, orientation, u, v, mask)


@sample_light.by(TexturedAreas)
@kernel
def sample_textured_area(areas, kind, light, mask, position, x, y, z):
    """Sample a point by the luminance of the texture."""
    u, v = choose_uv(areas.choice, light, x, y, mask)
    chosen = _at_uv(areas, light, u, v, mask)
    to_light = chosen.position - position
    r = length(to_light)
    wi = to_light / r
    cosine = -dot(wi, chosen.side)
    pdf = uv_density(areas.choice, light, u, v, mask) * r * r / (chosen.area * cosine)
    usable = chosen.found & (cosine > 0.0) & (pdf > 0.0)
    inverse = select(usable, 1.0 / pdf, splat_f32(0.0))
    prim = gather_row(areas.prim, 0, light, mask)
    color = light_color(areas.textures, light, u, v, prim, chosen.position, mask)
    return LightSample(wi, r, color * inverse, select(usable, pdf, splat_f32(0.0)))


@emitted_light.by(TexturedAreas)
@kernel
def _emitted(areas, kind, points, i, light, mask):
    """Return the radiance of a hit, and the pdf of its (u, v) in the texture."""
    _, distance, cosine = seen_from(kind.arithmetic, points, i)
    u, v = load_row(points.uv, 0, i), load_row(points.uv, 1, i)
    here = _at_uv(areas, light, u, v, mask)
    pdf = uv_density(areas.choice, light, u, v, mask)
    pdf = pdf * distance * distance / (here.area * cosine)
    pdf = select(here.found & (pdf > 0.0), pdf, splat_f32(0.0))
    prim, position = load_row(points.prim, 0, i), load3(points.position, i)
    return light_color(areas.textures, light, u, v, prim, position, mask), pdf
