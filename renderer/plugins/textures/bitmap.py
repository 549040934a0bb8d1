"""Bitmap textures: nearest or bilinear look-up of texels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    floor,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.plugins.textures.kind import LUMINANCE, TextureKind
from renderer.plugins.textures.texels import (
    as_color,
    as_number,
    chosen,
    packed_texels,
    texel_at,
)
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import BitmapTexture
from renderer.scene_file.images.image import Image, linear_values, negative_pixels
from renderer.scene_file.objects.objects import location_of, read_picture

REPEAT = 0
MIRROR = 1
CLAMP = 2
NEAREST = 4  # no interpolation
FORMATS = ("auto", "variant", "fp16", "float16", "uint8")
_WRAP = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}


class Bitmaps(NamedTuple):
    """Bitmaps with the same texel format; columns by texture id."""

    texels: Any  # see `plugins.textures.texels`; row after row from the top
    start: NDArray[np.int32]  # (n,) first texel
    width: NDArray[np.int32]  # (n,)
    height: NDArray[np.int32]  # (n,)
    mode: NDArray[np.int32]  # (n,) REPEAT, MIRROR or CLAMP, or'ed with NEAREST


def read(properties: Any, use: Use) -> BitmapTexture:
    """Read the properties of a file, and the image that it names."""
    image, name, key = read_picture(properties, ("data", "bitmap"))
    location = location_of(properties, key)
    raw = properties.boolean("raw", False)
    storage = properties.choice("format", "auto", FORMATS)
    properties.boolean("accel", True)  # for GPU backends; ignored
    texels, srgb = image.texels, image.srgb and not raw
    if storage == "uint8" and texels.dtype != np.uint8:
        properties.fail("format", f'"uint8" for texels of {texels.dtype}', "auto")
    if storage == "auto" and texels.dtype == np.uint16:
        storage = "float16"
    if storage == "auto" and srgb and texels.dtype.kind == "f":  # from a dictionary
        storage = "variant" if texels.dtype == np.float32 else "float16"
    if storage not in ("auto", "uint8"):
        with np.errstate(over="ignore", invalid="ignore"):
            kept = np.float32 if storage == "variant" else np.float16
            texels, srgb = linear_values(texels, srgb).astype(kept), False
        if not np.isfinite(texels).all():
            properties.fail("format", "half floats", "variant: there are larger pixels")
    bitmap = BitmapTexture(
        # Mitsuba has the top row of the file at v = 0; the record has row 0 at v = 1.
        np.ascontiguousarray(texels[::-1]),
        properties.choice("filter_type", "bilinear", ("bilinear", "nearest")),
        properties.choice("wrap_mode", "repeat", ("repeat", "mirror", "clamp")),
        properties.uv_transform("to_uv"),
        srgb,
    )
    # Mitsuba accepts these values, so they are accepted here too, with a warning.
    floats = use is Use.REFLECTANCE and texels.dtype.kind == "f"
    if floats and (largest := float(texels.max())) > 1.0:
        properties.reading.warn(
            location, f"{name} has reflectances up to {largest:g}; energy is not conserved"
        )
    if use in (Use.REFLECTANCE, Use.EMISSION) and (negative := negative_pixels(texels)):
        properties.reading.warn(
            location, f"{name}: {negative}; they are kept, as in Mitsuba"
        )
        if mean(bitmap) < 0.0:
            properties.fail(key, f"{name} with a negative mean ({negative})", use.value)
    return bitmap


def mean(bitmap: BitmapTexture, mean_of: Any = None) -> float:
    """Return the mean luminance of the texels."""
    linear = Image(bitmap.texels, bitmap.srgb).linear  # not cached, as `pixels` would be
    mean_color = linear.mean(axis=(0, 1), dtype=np.float64)
    return float(mean_color @ LUMINANCE)


def format_of(bitmap: BitmapTexture) -> tuple[str, int, bool]:
    """Return the key of a table: type and number of channels, and encoding."""
    return bitmap.texels.dtype.name, bitmap.texels.shape[2], bitmap.srgb


def bitmap_table(textures: list[BitmapTexture | None], scene: Any) -> Bitmaps:
    """Pack bitmaps of one format into one record."""
    mine = [bitmap for bitmap in textures if bitmap is not None]
    sizes = [b.texels.shape[:2] if b is not None else (0, 0) for b in textures]
    heights, widths = (np.array(size, np.int32) for size in zip(*sizes, strict=True))
    total = heights.astype(np.int64) * widths
    return Bitmaps(
        packed_texels([bitmap.texels for bitmap in mine], mine[0].srgb),
        (np.cumsum(total) - total).astype(np.int32),
        widths,
        heights,
        np.array([_mode(b) if b else 0 for b in textures], np.int32),
    )


def _mode(bitmap: BitmapTexture) -> int:
    nearest = NEAREST if bitmap.filter_type == "nearest" else 0
    return _WRAP[bitmap.wrap_mode] | nearest


@kernel
def wrapped(i, size, mode):
    """Return texel coordinates, wrapped into [0, size)."""
    n = to_f32(size)
    x = to_f32(i)
    period = floor(x / n)
    repeated = x - period * n
    # every second period of a mirrored image is reversed
    odd = period - 2.0 * floor(period * 0.5) != 0.0
    mirrored = select(odd, n - 1.0 - repeated, repeated)
    clamped = minimum(maximum(x, splat_f32(0.0)), n - 1.0)
    wrapped = select(mode == CLAMP, clamped, select(mode == MIRROR, mirrored, repeated))
    # rounding may give a whole period
    return to_i32(minimum(maximum(wrapped, splat_f32(0.0)), n - 1.0))


@kernel
def _interpolated(bitmaps, texture, point, mask):
    """Return the nearest texel, or bilinear interpolation; v is up, rows go down."""
    start = gather_row(bitmaps.start, 0, texture, mask)
    width = gather_row(bitmaps.width, 0, texture, mask)
    height = gather_row(bitmaps.height, 0, texture, mask)
    mode = gather_row(bitmaps.mode, 0, texture, mask)
    nearest = (mode & NEAREST) != 0
    mode = mode & ~NEAREST
    half = select(nearest, splat_f32(0.0), splat_f32(0.5))
    x = point.u * to_f32(width) - half
    y = (1.0 - point.v) * to_f32(height) - half
    x0 = floor(x)
    # a point on the edge of two texels belongs to the one with larger v; surfaces without
    # uv have all their points on such an edge
    upwards = to_f32(height) - 1.0 - floor(point.v * to_f32(height))
    y0 = select(nearest, upwards, floor(y))
    left = wrapped(to_i32(x0), width, mode)
    above = start + wrapped(to_i32(y0), height, mode) * width
    texel = texel_at(bitmaps.texels, above + left, mask)
    smooth = mask & ~nearest
    if mask_bits(smooth) == 0:
        return texel
    fx = x - x0
    fy = y - y0
    right = wrapped(to_i32(x0) + 1, width, mode)
    below = start + wrapped(to_i32(y0) + 1, height, mode) * width
    right_of = texel_at(bitmaps.texels, above + right, smooth)
    under = texel_at(bitmaps.texels, below + left, smooth)
    across = texel_at(bitmaps.texels, below + right, smooth)
    upper = texel * (1.0 - fx) + right_of * fx
    lower = under * (1.0 - fx) + across * fx
    mean = upper * (1.0 - fy) + lower * fy
    return chosen(bitmaps.texels, smooth, mean, texel)


@kernel
def bitmap_color(bitmaps, texture, point, mask):
    """Return the colour at (u, v)."""
    return as_color(bitmaps.texels, _interpolated(bitmaps, texture, point, mask))


@kernel
def bitmap_scalar(bitmaps, texture, point, mask):
    """Return the luminance at (u, v)."""
    return as_number(bitmaps.texels, _interpolated(bitmaps, texture, point, mask))


BITMAP = TextureKind(
    "bitmap",
    BitmapTexture,
    read,
    bitmap_table,
    Bitmaps,
    bitmap_color,
    bitmap_scalar,
    mean,
    format_of,
)
