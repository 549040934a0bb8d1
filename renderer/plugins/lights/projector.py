"""Projector: a point light with a textured slide. Mitsuba's `projector`.

E = pi L(u, v) / (z^2 cos) cos_i: a pinhole camera with the same field of view, reversed. At
distance 1 on the axis the irradiance is pi times the texture's colour.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import dot, gather_vectors, length
from renderer.plugins.lights.kind import (
    STRETCH,
    LightPlugin,
    LightSample,
    SphereAround,
    number_column,
    sample_light,
    vector_columns,
)
from renderer.plugins.lights.light_tree import LightBounds, in_cone
from renderer.plugins.lights.textures import LightTextures, light_color, refuse_nested
from renderer.plugins.textures.registry import mean_of
from renderer.scene_file import transforms
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import BitmapTexture, Projector
from renderer.scene_file.objects.objects import read_texture
from renderer.scene_file.objects.sensors import read_fov_x


@table_columns("position", "left", "up", "axis")
class Projectors(NamedTuple):
    """Columns by light id."""

    textures: LightTextures
    position: NDArray[np.float32]  # (4, n)
    left: NDArray[np.float32]  # (4, n) local x, divided by the slide's width at z = 1
    up: NDArray[np.float32]  # (4, n) local y, divided by its height
    axis: NDArray[np.float32]  # (4, n) unit
    strength: NDArray[np.float32]  # (n,) pi times the scale


def read(properties: Any) -> Projector:
    """Read the properties of a file."""
    to_world = properties.transform("to_world")
    lengths = transforms.column_lengths(to_world)
    if transforms.has_shear(to_world) or np.abs(lengths - 1.0).max() > STRETCH:
        properties.fail("to_world", "a transform that scales", "rotation and translation")
    irradiance = read_texture(properties, "irradiance", 1.0, Use.EMISSION)
    refuse_nested(properties, "irradiance", irradiance)
    aspect = 1.0
    if isinstance(irradiance, BitmapTexture):
        height, width = (max(n, 2) for n in irradiance.texels.shape[:2])
        aspect = width / height
    scale = properties.number("scale", 1.0, at_least=0.0, at_most=1e30)
    return Projector(to_world, irradiance, scale, read_fov_x(properties, aspect), aspect)


def table(
    count: int, lights: dict[int, Projector], around: SphereAround, textures: LightTextures
) -> Projectors:
    """Return the lights as columns."""
    widths = {i: 2.0 * np.tan(np.radians(0.5 * e.fov_x)) for i, e in lights.items()}
    heights = {i: widths[i] / e.aspect for i, e in lights.items()}
    ways = {i: e.to_world[:3, :3].T for i, e in lights.items()}  # x, y, z
    return Projectors(
        textures,
        vector_columns(count, {i: e.to_world[:3, 3] for i, e in lights.items()}),
        vector_columns(count, {i: ways[i][0] / widths[i] for i in lights}),
        vector_columns(count, {i: ways[i][1] / heights[i] for i in lights}),
        vector_columns(count, {i: ways[i][2] for i in lights}),
        number_column(count, {i: np.pi * e.scale for i, e in lights.items()}),
    )


def bounds(light: Projector) -> LightBounds:
    """Return the bounds: intensity on the axis, and a cone through the slide's corners."""
    width = 2.0 * np.tan(np.radians(0.5 * light.fov_x))
    corner = float(np.arctan(0.5 * np.hypot(width, width / light.aspect)))
    intensity = float(np.pi) * light.scale * mean_of(light.irradiance)
    return in_cone(light.to_world[:3, 3], intensity, light.to_world[:3, 2], corner, 0.0)


@sample_light.by(Projectors)
@kernel
def sample_projector(projectors, kind, light, mask, position, x, y, z):
    """Return the direction to the light, and the incident radiance through its slide."""
    to_light = gather_vectors(projectors.position, light, mask) - position
    r = length(to_light)
    along = -dot(to_light, gather_vectors(projectors.axis, light, mask))
    ahead = along > 0.0
    inverse = 1.0 / select(ahead, along, splat_f32(1.0))
    u = 0.5 + dot(to_light, gather_vectors(projectors.left, light, mask)) * inverse
    v = 0.5 + dot(to_light, gather_vectors(projectors.up, light, mask)) * inverse
    lit = ahead & (u >= 0.0) & (u <= 1.0) & (v >= 0.0) & (v <= 1.0)
    # z^2 cos = z^3 / r
    strength = gather_row(projectors.strength, 0, light, mask)
    strength = strength * r * inverse * inverse * inverse
    color = light_color(projectors.textures, light, u, v, None, None, mask)
    radiance = color * select(lit, strength, splat_f32(0.0))
    return LightSample(to_light / r, r, radiance, splat_f32(0.0))


PROJECTOR = LightPlugin("projector", Projector, read, table, bounds, texture="irradiance")
