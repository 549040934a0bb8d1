"""Texels in the formats of image files: bytes, half and single precision floats.

A look-up reads four texels per point, far apart in memory: its time is that of the memory
accesses. A texel of three bytes is stored in one word and takes one gather. sRGB is decoded
by a table of 256 numbers, which stays in the first-level cache. Three half floats take two
words. Texels of one channel are scalars, those of three channels vectors.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, interface, kernel, table_columns
from renderer.kernels.lanes.functions import as_f32, select
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather_vectors, select3, vec3
from renderer.plugins.textures.kind import LUMINANCE
from renderer.scene_file.images.image import decoded_bytes

# the exponent bias of half precision is 15, that of single precision 127
_HALF = np.float32(2.0**112)
_R, _G, _B = (np.float32(weight) for weight in LUMINANCE)


class ByteColors(NamedTuple):
    """Three bytes per texel, in one word."""

    words: NDArray[np.int32]  # (n,)
    decoded: NDArray[np.float32]  # (256,) value of each byte


class Bytes(NamedTuple):
    """One byte per texel, four in a word."""

    words: NDArray[np.int32]  # (n / 4,)
    decoded: NDArray[np.float32]  # (256,)


class HalfColors(NamedTuple):
    """Three half floats per texel."""

    words: NDArray[np.int32]  # (2, n) red and green; blue


class Halves(NamedTuple):
    """One half float per texel, two in a word."""

    words: NDArray[np.int32]  # (n / 2,)


@table_columns("values")
class FloatColors(NamedTuple):
    """Three floats per texel."""

    values: NDArray[np.float32]  # (4, n) the last is unused


class Floats(NamedTuple):
    """One float per texel."""

    values: NDArray[np.float32]  # (n,)


def packed_texels(images: list[NDArray[Any]], srgb: bool) -> Any:
    """Return the texels of images, row after row, one image after the other.

    Parameters
    ----------
    images
        (H, W, 1 or 3) each, all of one type: uint8, float16 or float32.
    srgb
        Whether bytes are sRGB encoded.
    """
    texels = np.concatenate([image.reshape(-1, image.shape[2]) for image in images])
    channels = texels.shape[1]
    if texels.dtype == np.float32:
        if channels == 1:
            return Floats(np.ascontiguousarray(texels[:, 0]))
        return FloatColors(by_columns(np.pad(texels, [(0, 0), (0, 1)]).T))
    # bytes and halves are padded to words
    whole = np.zeros((len(texels), 4), texels.dtype)
    if channels == 1:
        whole = np.zeros((-(-len(texels) // 4) * 4, 1), texels.dtype)
    whole[: len(texels), :channels] = texels
    words = whole.view(np.int32) if channels == 3 else whole.ravel().view(np.int32)
    if texels.dtype == np.uint8:
        decoded = decoded_bytes(srgb)
        if channels == 1:
            return Bytes(words, decoded)
        return ByteColors(np.ascontiguousarray(words[:, 0]), decoded)
    if channels == 1:
        return Halves(words)
    return HalfColors(np.ascontiguousarray(words.T))


@interface
def texel_at(texels: Any, index: Any, mask: Any) -> Any:
    """Return texels by index; those of a single channel as scalars."""


@interface
def chosen(texels: Any, mask: Any, yes: Any, no: Any) -> Any:
    """Select between texels, lane by lane."""


@interface
def as_color(texels: Any, x: Any) -> Any:
    """Return texels as colours."""


@interface
def as_number(texels: Any, x: Any) -> Any:
    """Return texels as scalars."""


@kernel
def _decoded(decoded, words, shift, mask):
    return gather_row(decoded, 0, (words >> shift) & 255, mask)


@texel_at.by(ByteColors)
@kernel
def _byte_color(texels, index, mask):
    words = gather_row(texels.words, 0, index, mask)
    return vec3(
        _decoded(texels.decoded, words, 0, mask),
        _decoded(texels.decoded, words, 8, mask),
        _decoded(texels.decoded, words, 16, mask),
    )


@texel_at.by(Bytes)
@kernel
def _byte(texels, index, mask):
    words = gather_row(texels.words, 0, index >> 2, mask)
    return _decoded(texels.decoded, words, (index & 3) * 8, mask)


@kernel
def _single(half):
    """Return half floats from the lower 16 bits, exactly; they must not be negative."""
    return as_f32((half & 0x7FFF) << 13) * _HALF


@texel_at.by(HalfColors)
@kernel
def _half_color(texels, index, mask):
    first = gather_row(texels.words, 0, index, mask)
    second = gather_row(texels.words, 1, index, mask)
    return vec3(_single(first), _single(first >> 16), _single(second))


@texel_at.by(Halves)
@kernel
def _half(texels, index, mask):
    words = gather_row(texels.words, 0, index >> 1, mask)
    return _single(select((index & 1) == 0, words, words >> 16))


@texel_at.by(FloatColors)
@kernel
def _float_color(texels, index, mask):
    return gather_vectors(texels.values, index, mask)


@texel_at.by(Floats)
@kernel
def _float(texels, index, mask):
    return gather_row(texels.values, 0, index, mask)


_COLORS, _NUMBERS = (ByteColors, HalfColors, FloatColors), (Bytes, Halves, Floats)


@chosen.by(*_COLORS, drop_first=True)
@kernel
def _chosen_color(mask, yes, no):
    return select3(mask, yes, no)


@chosen.by(*_NUMBERS, drop_first=True)
@kernel
def _chosen_number(mask, yes, no):
    return select(mask, yes, no)


@as_color.by(*_COLORS, drop_first=True)
@as_number.by(*_NUMBERS, drop_first=True)
@kernel
def _as_it_is(x):
    return x


@as_color.by(*_NUMBERS, drop_first=True)
@kernel
def _grey(x):
    return vec3(x, x, x)


@as_number.by(*_COLORS, drop_first=True)
@kernel
def _luminance(x):
    return x.x * _R + x.y * _G + x.z * _B
