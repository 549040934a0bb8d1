"""Sampling of points (u, v) of a light's texture by luminance.

A row of texels is sampled by its luminance, then a texel of the row. The rest of the random
numbers gives the position near its centre by the tent filter of bilinear interpolation, or
within the texel. So the pdf is the interpolant of the texels' probabilities. As in Mitsuba,
the transform `to_uv` of the texture is ignored.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    floor,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.plugins.textures.bitmap import wrapped
from renderer.plugins.textures.kind import LUMINANCE
from renderer.scene_file.description import BitmapTexture

_WRAP = {"repeat": 0, "mirror": 1, "clamp": 2}  # the codes of `plugins.textures.bitmap`
_BELOW_ONE = np.float32(1.0 - 2.0**-24)
_SMALLEST = np.float32(1.1754944e-38)


class AnyUv(NamedTuple):
    """Uniform sampling of the unit square, for textures other than bitmaps."""


class TexelChoice(NamedTuple):
    """Columns by light id; cumulative luminances of all texels, from v = 0 up."""

    texels: NDArray[np.float32]  # (total,) cumulative within each row
    rows: NDArray[np.float32]  # (total rows,) cumulative within each image
    first_texel: NDArray[np.int32]  # (n,)
    first_row: NDArray[np.int32]  # (n,)
    width: NDArray[np.int32]  # (n,)
    height: NDArray[np.int32]  # (n,)
    nearest: NDArray[np.int32]  # (n,) 1: no interpolation
    wrap: NDArray[np.int32]  # (n,)
    inverse_sum: NDArray[np.float32]  # (n,) 1 / sum of the luminance of all texels


def texel_luminance(bitmap: BitmapTexture) -> NDArray[np.float32]:
    """Return the luminance of texels, (H, W), row 0 at v = 0; negative ones become 0."""
    pixels = bitmap.pixels[::-1]
    more = [(0, max(0, 2 - n)) for n in pixels.shape[:2]]
    pixels = np.pad(pixels, [*more, (0, 0)], mode="edge")
    weights = np.array(LUMINANCE, np.float32)
    return np.asarray(np.maximum(pixels @ weights, 0.0), np.float32)


def uv_choice(count: int, textures: dict[int, Any]) -> Any:
    """Return the sampling table for lights with textures of one kind."""
    if not all(isinstance(texture, BitmapTexture) for texture in textures.values()):
        return AnyUv()
    columns = np.zeros((6, count), np.int32)
    columns[2:4] = 1
    inverse = np.zeros(count, np.float32)
    texels: list[NDArray[np.float32]] = []
    rows: list[NDArray[np.float32]] = []
    for light, bitmap in textures.items():
        luminance = texel_luminance(bitmap).astype(np.float64)
        by_texel = np.cumsum(luminance, axis=1)
        by_row = np.cumsum(by_texel[:, -1])
        height, width = luminance.shape
        columns[:, light] = (
            sum(part.size for part in texels),
            sum(part.size for part in rows),
            width,
            height,
            bitmap.filter_type == "nearest",
            _WRAP[bitmap.wrap_mode],
        )
        inverse[light] = 1.0 / by_row[-1]
        texels.append(by_texel.ravel().astype(np.float32))
        rows.append(by_row.astype(np.float32))
    return TexelChoice(np.concatenate(texels), np.concatenate(rows), *columns, inverse)


@interface
def choose_uv(choice: Any, light: Any, x: Any, y: Any, mask: Any) -> Any:
    """Map numbers in [0, 1) to points (u, v) of the unit square."""


@interface
def uv_density(choice: Any, light: Any, u: Any, v: Any, mask: Any) -> Any:
    """Return the pdf of `choose_uv` in (u, v)."""


@choose_uv.by(AnyUv)
@kernel
def _any_uv(choice, light, x, y, mask):
    return x, y


@uv_density.by(AnyUv)
@kernel
def _even(choice, light, u, v, mask):
    return splat_f32(1.0)


@kernel
def _search(cumulated, first, count, wanted, mask):
    """Return the first index whose cumulative sum reaches `wanted`, and the remainder."""
    low, high = first, first + count - 1
    searching = mask & (low < high)
    while mask_bits(searching) != 0:
        middle = (low + high) >> 1
        short = gather_row(cumulated, 0, middle, searching) < wanted
        low = select(searching & short, middle + 1, low)
        high = select(searching & ~short, middle, high)
        searching = mask & (low < high)
    below = gather_row(cumulated, 0, low - 1, mask & (low > first))
    own = gather_row(cumulated, 0, low, mask) - below
    rest = wanted - below
    return low - first, select(own > 0.0, rest / select(own > 0.0, own, 1.0), rest)


@kernel
def _tent(x):
    """Map [0, 1) to [-1, 1] with density 1 - |t|."""
    y = x - 0.5
    t = 1.0 - sqrt(maximum(1.0 - 2.0 * fabs(y), splat_f32(0.0)))
    return select(y < 0.0, -t, t)


@kernel
def _inside(t, repeats):
    """Wrap coordinates up to half a texel outside of the unit interval back into it."""
    below = select(repeats, t + 1.0, -t)
    above = select(repeats, t - 1.0, 2.0 - t)
    return select(t < 0.0, below, select(t > 1.0, above, t))


@choose_uv.by(TexelChoice)
@kernel
def _choose_texel(choice, light, x, y, mask):
    width = gather_row(choice.width, 0, light, mask)
    height = gather_row(choice.height, 0, light, mask)
    first_row = gather_row(choice.first_row, 0, light, mask)
    x = minimum(maximum(x, splat_f32(_SMALLEST)), splat_f32(_BELOW_ONE))
    y = minimum(maximum(y, splat_f32(_SMALLEST)), splat_f32(_BELOW_ONE))
    total = gather_row(choice.rows, 0, first_row + height - 1, mask)
    row, y = _search(choice.rows, first_row, height, y * total, mask)
    first = gather_row(choice.first_texel, 0, light, mask) + row * width
    total = gather_row(choice.texels, 0, first + width - 1, mask)
    column, x = _search(choice.texels, first, width, x * total, mask)
    nearest = gather_row(choice.nearest, 0, light, mask) != 0
    x = select(nearest, x, 0.5 + _tent(x))
    y = select(nearest, y, 0.5 + _tent(y))
    u = (to_f32(column) + x) * (1.0 / to_f32(width))
    v = (to_f32(row) + y) * (1.0 / to_f32(height))
    repeats = gather_row(choice.wrap, 0, light, mask) == 0
    return _inside(u, repeats), _inside(v, repeats)


@kernel
def _share(choice, light, first, width, height, mode, x, y, mask):
    """Return the luminance of a texel."""
    column, row = wrapped(x, width, mode), wrapped(y, height, mode)
    k = first + row * width + column
    below = gather_row(choice.texels, 0, k - 1, mask & (column > 0))
    return gather_row(choice.texels, 0, k, mask) - below


@uv_density.by(TexelChoice)
@kernel
def _texel_density(choice, light, u, v, mask):
    width = gather_row(choice.width, 0, light, mask)
    height = gather_row(choice.height, 0, light, mask)
    first = gather_row(choice.first_texel, 0, light, mask)
    mode = gather_row(choice.wrap, 0, light, mask)
    nearest = gather_row(choice.nearest, 0, light, mask) != 0
    half = select(nearest, splat_f32(0.0), splat_f32(0.5))
    x, y = u * to_f32(width) - half, v * to_f32(height) - half
    i, j = floor(x), floor(y)
    a, b = select(nearest, 0.0, x - i), select(nearest, 0.0, y - j)
    i, j = to_i32(i), to_i32(j)
    lower = _share(choice, light, first, width, height, mode, i, j, mask) * (1.0 - a)
    right = _share(choice, light, first, width, height, mode, i + 1, j, mask)
    upper = _share(choice, light, first, width, height, mode, i, j + 1, mask) * (1.0 - a)
    across = _share(choice, light, first, width, height, mode, i + 1, j + 1, mask)
    mean = (lower + right * a) * (1.0 - b) + (upper + across * a) * b
    scale = gather_row(choice.inverse_sum, 0, light, mask)
    return mean * (scale * to_f32(width * height))
