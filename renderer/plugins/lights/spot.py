"""Spot light: a point light that fades linearly in angle from beam width to cutoff."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.mathematics import arccos
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
from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.description import ConstantTexture, SpotLight
from renderer.scene_file.objects.objects import read_texture


@table_columns("position", "axis", "intensity")
class SpotLights(NamedTuple):
    """Columns by light id."""

    position: NDArray[np.float32]  # (4, n)
    axis: NDArray[np.float32]  # (4, n) unit
    intensity: NDArray[np.float32]  # (4, n)
    cos_cutoff: NDArray[np.float32]  # (n,)
    cos_beam: NDArray[np.float32]  # (n,)
    cutoff: NDArray[np.float32]  # (n,) [rad]
    inverse_transition: NDArray[np.float32]  # (n,) 1 / (cutoff - beam width) [1/rad]
    across: Any  # with textures, `SpotSquares`; else None


@table_columns("right", "up")
class SpotSquares(NamedTuple):
    """The squares at z = 1 of each light that textures cover; columns by light id."""

    textures: LightTextures
    right: NDArray[np.float32]  # (4, n) local x axis, divided by twice the half width
    up: NDArray[np.float32]  # (4, n)


def read(properties: Any) -> SpotLight:
    """Read the properties of a file."""
    to_world = properties.transform("to_world")
    lengths = transforms.column_lengths(to_world)
    if transforms.has_shear(to_world) or np.ptp(lengths) > STRETCH * lengths.max():
        properties.fail(
            "to_world",
            "a transform that distorts the cone",
            "a rotation, translation and uniform scale",
        )
    to_world[:3, :3] /= lengths  # a scale has no effect on a point light
    cutoff = properties.number("cutoff_angle", 20.0, above=0.0, at_most=180.0)
    beam = properties.number("beam_width", 0.75 * cutoff, at_least=0.0, at_most=cutoff)
    intensity = read_color(properties, "intensity", 1.0, Use.EMISSION)
    texture = None
    if properties.has("texture"):
        texture = read_texture(properties, "texture", 1.0)
        if isinstance(texture, ConstantTexture):
            properties.fail("texture", "one colour", "a texture that varies")
        refuse_nested(properties, "texture", texture)
        if cutoff >= 90.0:
            properties.fail("cutoff_angle", f"{cutoff:g} with a texture", "less than 90")
    return SpotLight(to_world, intensity, cutoff, beam, texture, float(lengths.max()))


def table(
    count: int,
    lights: dict[int, SpotLight],
    around: SphereAround,
    textures: LightTextures | None,
) -> SpotLights:
    """Return the lights as columns."""
    cutoff = {i: np.radians(e.cutoff_angle) for i, e in lights.items()}
    beam = {i: np.radians(e.beam_width) for i, e in lights.items()}
    axes = {
        i: e.to_world[:3, 2] / np.linalg.norm(e.to_world[:3, 2]) for i, e in lights.items()
    }
    widths = {i: cutoff[i] - beam[i] for i in lights}
    return SpotLights(
        vector_columns(count, {i: e.to_world[:3, 3] for i, e in lights.items()}),
        vector_columns(count, axes),
        vector_columns(count, {i: e.intensity for i, e in lights.items()}),
        number_column(count, {i: np.cos(a) for i, a in cutoff.items()}),
        number_column(count, {i: np.cos(a) for i, a in beam.items()}),
        number_column(count, cutoff),
        # narrower transitions have no inverse in float32; there the edge is sharp
        number_column(count, {i: 1.0 / w if w > 1e-30 else 0.0 for i, w in widths.items()}),
        None if textures is None else _squares(count, lights, textures),
    )


def _squares(
    count: int, lights: dict[int, SpotLight], textures: LightTextures
) -> SpotSquares:
    sides = []
    for axis in (0, 1):
        half = {i: max(np.radians(e.cutoff_angle), 1e-30) for i, e in lights.items()}
        inverse = {i: 0.5 / np.tan(angle) for i, angle in half.items()}
        ways = {i: e.to_world[:3, axis] * inverse[i] for i, e in lights.items()}
        sides.append(vector_columns(count, ways))
    return SpotSquares(textures, sides[0], sides[1])


def bounds(light: SpotLight) -> LightBounds:
    """Return the bounds: full intensity up to the beam width."""
    slide = 1.0 if light.texture is None else mean_of(light.texture)
    beam, cutoff = np.radians([light.beam_width, light.cutoff_angle])
    intensity = float(np.mean(light.intensity)) * slide
    place, axis = light.to_world[:3, 3], light.to_world[:3, 2]
    return in_cone(place, intensity, axis, beam, cutoff - beam)


@kernel
def _through_slide(radiance, square, light, wi, cosine, mask):
    """Return the radiance, multiplied by the lights' textures in the direction -wi."""
    if square is None:
        return radiance
    along = -1.0 / select(cosine > 0.0, cosine, splat_f32(1.0))
    u = 0.5 + dot(wi, gather_vectors(square.right, light, mask)) * along
    v = 0.5 + dot(wi, gather_vectors(square.up, light, mask)) * along
    return radiance * light_color(square.textures, light, u, v, None, None, mask)


@kernel
def spot_falloff(spots, light, cosine, angle, mask):
    """Return the falloff of the intensity at an angle from the axis, in [0, 1]."""
    from_cutoff = gather_row(spots.cutoff, 0, light, mask) - angle
    fading = from_cutoff * gather_row(spots.inverse_transition, 0, light, mask)
    falloff = select(
        cosine >= gather_row(spots.cos_beam, 0, light, mask), splat_f32(1.0), fading
    )
    lit = cosine > gather_row(spots.cos_cutoff, 0, light, mask)
    return select(lit, falloff, splat_f32(0.0))


@kernel
def axis_cosine(spots, light, wi, mask):
    """Return the cosine between a light's axis and -wi."""
    return -dot(wi, gather_vectors(spots.axis, light, mask))


@kernel
def falling_off(spots, light, to_light, cosine, falloff, mask):
    """Return the light samples in the direction `to_light`."""
    r = length(to_light)
    wi = to_light / r
    radiance = gather_vectors(spots.intensity, light, mask) * (
        falloff / dot(to_light, to_light)
    )
    radiance = _through_slide(radiance, spots.across, light, wi, cosine, mask)
    return LightSample(wi, r, radiance, splat_f32(0.0))


@sample_light.by(SpotLights)
@kernel
def sample_spot(spots, kind, light, mask, position, x, y, z):
    """Return the direction to the light, and the incident radiance."""
    to_light = gather_vectors(spots.position, light, mask) - position
    cosine = axis_cosine(spots, light, to_light / length(to_light), mask)
    falloff = spot_falloff(spots, light, cosine, arccos(cosine), mask)
    return falling_off(spots, light, to_light, cosine, falloff, mask)


SPOT = LightPlugin("spot", SpotLight, read, table, bounds, texture="texture")
