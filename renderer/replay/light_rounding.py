"""Lights with Mitsuba's rounding."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    mask_bits,
    maximum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import arccos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather_rows3, gather_vectors, length
from renderer.plugins.lights.kind import SphereAround, sample_light
from renderer.plugins.lights.spot import SpotLights, axis_cosine, falling_off, spot_falloff
from renderer.plugins.shapes.triangle import choose_triangle
from renderer.plugins.textures.kind import LUMINANCE
from renderer.plugins.textures.registry import kind_of_texture, mean_of
from renderer.replay.arithmetic import Floats, arccos_as_mitsuba, fused, fused_in_numpy
from renderer.replay.exact_hits import triangle_areas
from renderer.scene.materials import MaterialTables, kind_of, value_of
from renderer.scene_file.description import BitmapTexture, SpotLight

# ------------------------------------------------------------------------------ distant


def sphere_around(bounds: NDArray[np.float64], ray_epsilon: float) -> SphereAround:
    """Return Mitsuba's sphere around a scene with the given corners (2, 3).

    Light samples of lights at infinity end two radii away (`distance_beyond`). Mitsuba's
    boxes of curves and `sdfgrid` are larger than ours, its sphere by up to 2 %.
    """
    low, high = bounds.astype(np.float32)
    center = np.float32(0.5) * (low + high)
    radius = np.linalg.norm(center - high) * np.float32(1.0 + ray_epsilon)
    return SphereAround(center, max(float(radius), ray_epsilon))


# -------------------------------------------------------------------------------- spots
# Spot lights in a replay: Mitsuba's computation of the angle from the axis.
#
# The angle of a cosine c has the rounding error of c divided by the sine. A falloff over a
# few degrees divides that by its width: near the rim, where the falloff is small, it is
# 1e-3 of its value. With the same operations 2000 of 2000 samples agreed in all bits.

_COSINE = np.float32(3e-7)  # rounding of a cosine near 1: five units in the last place

_WIDTH = np.float32(2.0**-23)  # relative to the cutoff: rounding error of a rim's width


class RoundedSpots(NamedTuple):
    """Spot lights with both our and Mitsuba's rounding; columns by light id."""

    own: SpotLights
    theirs: SpotLights  # with Mitsuba's rounding of the rims' widths
    to_local: NDArray[np.float32]  # (9, n) rows of the matrices from the world


def rounded_spots(own: SpotLights, lights: dict[int, SpotLight]) -> RoundedSpots:
    """Return the tables of spot lights for a replay, by light id."""
    to_local = np.zeros((9, own.cutoff.size), np.float32)
    for light, spot in lights.items():
        to_local[:, light] = np.linalg.inv(spot.to_world[:3, :3] * spot.scale).ravel()
    degrees = np.float32(np.pi / 180.0)
    inverse = own.inverse_transition.copy()
    for light, spot in lights.items():
        width = np.float32(spot.cutoff_angle) * degrees
        width = width - np.float32(spot.beam_width) * degrees
        if width > 0.0 and inverse[light] > 0.0:
            inverse[light] = np.float32(1.0) / width
    return RoundedSpots(own, own._replace(inverse_transition=inverse), to_local)


@kernel
def _along(matrix, row, light, d, mask):
    a = gather_rows3(matrix, row, light, mask)
    return fused(a.z, d.z, fused(a.y, d.y, a.x * d.x))


@kernel
def _inverse_length(x, y, z):
    return 1.0 / sqrt((x * x + z * z) + y * y)


@kernel
def _cosine(spots, light, to_light, mask):
    away = to_light * -_inverse_length(to_light.x, to_light.y, to_light.z)
    x = _along(spots.to_local, 0, light, away, mask)
    y = _along(spots.to_local, 3, light, away, mask)
    z = _along(spots.to_local, 6, light, away, mask)
    return z * _inverse_length(x, y, z)


@sample_light.by(RoundedSpots)
@kernel
def _sample(spots, kind, light, mask, position, x, y, z):
    """Use Mitsuba's falloff if it differs from ours by a cosine's rounding only."""
    own = spots.own
    to_light = gather_vectors(own.position, light, mask) - position
    cosine = axis_cosine(own, light, to_light / length(to_light), mask)
    falloff = spot_falloff(own, light, cosine, arccos(cosine), mask)
    theirs = _cosine(spots, light, to_light, mask)
    rounded = spot_falloff(spots.theirs, light, theirs, arccos_as_mitsuba(theirs), mask)
    sine = sqrt(maximum(1.0 - cosine * cosine, splat_f32(2.0 * _COSINE)))
    angle = _COSINE / sine + falloff * (_WIDTH * gather_row(own.cutoff, 0, light, mask))
    most = angle * gather_row(own.inverse_transition, 0, light, mask)
    falloff = select(fabs(rounded - falloff) <= most, rounded, falloff)
    return falling_off(own, light, to_light, cosine, falloff, mask)


# -------------------------------------------------------------------------- mesh lights
# The triangle of a mesh light, chosen as in Mitsuba: by a search in cumulative areas.
#
# It uses part of one of the point's random numbers and reuses the remainder. Our own method
# (`renderer.plugins.shapes.triangle`) takes another number, and constant time.


class TriangleShares(NamedTuple):
    """Cumulative areas for choosing a triangle of a mesh light."""

    first: NDArray[np.int32]  # (n,) first column of each light's triangles below
    count: NDArray[np.int32]  # (n,)
    area: NDArray[np.float32]  # (n,) of the whole mesh
    cumulated: NDArray[np.float32]  # (total,) area up to and including a triangle
    below: NDArray[np.float32]  # (total,) fraction of the area before a triangle
    lost: NDArray[np.float32]  # (total,) rounding error of `below`
    share: NDArray[np.float32]  # (total,) fraction of the triangle itself
    prim: NDArray[np.int32]  # (total,) primitive id


def triangle_shares(count: int, triangles: Any, meshes: dict[int, Any]) -> TriangleShares:
    """Return the cumulative areas of mesh lights, rounded as in Mitsuba."""
    first, number = np.zeros(count, np.int32), np.zeros(count, np.int32)
    area = np.zeros(count, np.float32)
    columns: list[list[NDArray[Any]]] = []
    total = 0
    for light, (ids, _) in meshes.items():
        k = ids - triangles.first
        sizes = triangle_areas(triangles.edge1[:, k], triangles.edge2[:, k])
        cumulated = np.cumsum(sizes, dtype=np.float64).astype(np.float32)
        normalization = np.float32(1.0) / cumulated[-1]
        exact = np.append(0.0, cumulated[:-1].astype(np.float64)) * normalization
        below = exact.astype(np.float32)
        first[light], number[light], area[light] = total, len(ids), cumulated[-1]
        lost = (exact - below).astype(np.float32)
        columns.append([cumulated, below, lost, sizes * normalization, ids])
        total += len(ids)
    rows = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    return TriangleShares(first, number, area, *rows)


@choose_triangle.by(TriangleShares)
@kernel
def _by_search(table, light, mask, y, z):
    """Find the first triangle that reaches y; return it and the rescaled remainder of y.

    Mitsuba rounds y - cumulated / area once. For small triangles the rounding error of
    `below` is needed for that.
    """
    first = gather_row(table.first, 0, light, mask)
    wanted = y * gather_row(table.area, 0, light, mask)
    low = first
    high = first + gather_row(table.count, 0, light, mask) - 1
    searching = mask & (low < high)
    while mask_bits(searching) != 0:
        middle = (low + high) >> 1
        short = gather_row(table.cumulated, 0, middle, searching) < wanted
        low = select(searching & short, middle + 1, low)
        high = select(searching & ~short, middle, high)
        searching = mask & (low < high)
    below = gather_row(table.below, 0, low, mask)
    rest = (y - below) - gather_row(table.lost, 0, low, mask)
    rest = rest / gather_row(table.share, 0, low, mask)
    return gather_row(table.prim, 0, low, mask), rest


# ------------------------------------------------------------------------ texture means
# Means of bitmaps as Mitsuba sums them: texel after texel, in single precision.
#
# A sum of millions in 24 bits drifts: 0.094297 instead of 0.094341 for a picture of
# 2048 x 2048 texels, up to 1 % in others. `plastic` and `roughplastic` choose a lobe by
# such means, so all densities of a replay depend on them, to the last bit of a texel. With
# these texels the means of all 17 images that were tried agree in all bits.

_SHARE = "specular_share"  # a parameter of coated BSDFs that follows from two others
# sRGB to linear above 0.04045 as a quotient of polynomials, error 1e-7
_ABOVE = (-0.0163933279112946, -0.7386328024653209, -11.199318357635072)
_ABOVE += (-47.46726633009393, -36.04572663838034)
_BELOW = (-0.004261480793199332, -19.140923959601675, -59.096406619244426)
_BELOW += (-18.225745396846637, 1.0)


def rounded_shares(materials: MaterialTables) -> Floats:
    """Return the constant parameters of all BSDFs, with Mitsuba's lobe probabilities."""
    values = materials.values()
    for k, bsdf in enumerate(materials.bsdfs):
        rows = {name: first for name, first, _ in kind_of(bsdf).layout()}
        for name, row in rows.items():
            of = name.removesuffix(_SHARE)
            both = f"{of}diffuse_reflectance", f"{of}specular_reflectance"
            if not (name.endswith(_SHARE) and rows.keys() >= set(both)):
                continue
            parts = [value_of(bsdf, part) for part in both]
            # The drift for 10^8 texels has no useful bound. A share that does not follow
            # from the exact means is a defect, or something else, and is kept.
            if np.isclose(values[row, k], _share(mean_of, parts), rtol=1e-6, atol=0.0):
                values[row, k] = _share(rounded_mean, parts)
    return values


def _share(mean: Callable[[Any], float], parts: Sequence[Any]) -> float:
    diffuse, specular = map(mean, parts)
    return specular / (diffuse + specular) if diffuse + specular > 0.0 else math.nan


def rounded_mean(texture: Any) -> float:
    """Return the mean of a texture, with Mitsuba's summation for bitmaps."""
    if not isinstance(texture, BitmapTexture):
        kind = kind_of_texture(texture)
        return float(texture) if kind is None else kind.mean(texture, rounded_mean)
    texels = texture.texels[::-1]  # from the top row of the file
    if texels.dtype == np.uint8:
        decoded = np.arange(256, dtype=np.float32) * np.float32(1.0 / 255.0)
        texels = (_linear(decoded) if texture.srgb else decoded)[texels]
    texels = texels.astype(np.float32, copy=False)
    values = texels[..., 0]
    if texels.shape[2] == 3:
        r, g, b = np.moveaxis(texels, -1, 0)
        values = rounded_luminance(r, g, b)
    return float(np.cumsum(values.ravel(), dtype=np.float32)[-1] / np.float32(values.size))


def rounded_luminance(r: Floats, g: Floats, b: Floats) -> Floats:
    """Return the luminance of linear sRGB, fused as in Mitsuba's wheels."""
    red, green, blue = np.array(LUMINANCE, np.float32)
    return fused_in_numpy(b, blue, fused_in_numpy(r, red, g * green))


def _linear(encoded: Floats) -> Floats:
    above = _polynomial(encoded, _ABOVE) / _polynomial(encoded, _BELOW)
    straight = np.float32(1.0 / 12.92)
    return np.where(encoded > np.float32(0.04045), above, straight) * encoded


def _polynomial(x: Floats, coefficients: tuple[float, ...]) -> Floats:
    """Return c0 + c1 x + c2 x^2 + ..., with the terms summed in pairs."""
    terms = [np.full_like(x, c) for c in coefficients]
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        last = terms[-1:] if len(terms) % 2 else []
        terms = [fused_in_numpy(x, high, low) for low, high in pairs] + last
        x = x * x
    return terms[0]
