"""Reads PNG files with 16 bits per channel, which Pillow would reduce to 8.

A decoder after the PNG specification (W3C, third edition): chunks, zlib, then the five row
filters. Only grey and colour images are supported, with or without alpha, not interlaced.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.images.color_notes import (
    CHANNELS,
    HEAD,
    SIGNATURE,
    image_data,
    png_notes,
)
from renderer.scene_file.images.image import Image

_LARGEST = 2**28  # pixels


def is_16_bit_png(path: Path) -> bool:
    """Return whether a file is a PNG with a bit depth of 16."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    return len(head) == HEAD and head[:8] == SIGNATURE and head[24] == 16


def read_16_bit_png(path: Path) -> Image:
    """Return the values without alpha, as uint16.

    Raises
    ------
    SceneError
        If the file is damaged or interlaced.
    """
    # here, because importing Numba takes half a second that other files do not need
    from renderer.scene_file.images.png_filters import undo_filters

    content = path.read_bytes()
    width, height, _, color_type, _, _, interlace = struct.unpack(
        ">IIBBBBB", content[16:29]
    )
    channels = CHANNELS.get(color_type)
    if channels is None or color_type == 3 or not 0 < width * height <= _LARGEST:
        raise SceneError(f"{path}: damaged PNG: its header makes no sense")
    if interlace:
        raise SceneError(f"{path}: interlaced 16-bit PNG is not supported; save it without")
    # uncompressed, filtered, and as float64 for checks
    memory.require(42 * width * height * channels, f"{path}: the image")
    row_bytes = width * channels * 2
    expected = height * (row_bytes + 1)  # each row starts with the number of its filter
    try:
        inflater = zlib.decompressobj()
        packed = inflater.decompress(image_data(content), expected + 1)
    except (zlib.error, struct.error) as error:
        raise SceneError(f"{path}: damaged PNG: {error}") from None
    if len(packed) != expected:
        raise SceneError(
            f"{path}: damaged PNG: {len(packed)} bytes of pixels; expected {expected}"
        )
    rows = np.frombuffer(packed, np.uint8).reshape(height, row_bytes + 1)
    if rows[:, 0].max() > 4:
        raise SceneError(f"{path}: damaged PNG: unknown row filter {rows[:, 0].max()}")
    values = np.zeros((height + 1, row_bytes + channels * 2), np.uint8)
    undo_filters(rows, values, channels * 2)
    pixels = np.ascontiguousarray(values[1:, channels * 2 :]).view(">u2")
    pixels = pixels.reshape(height, width, channels).astype(np.uint16)
    colors = pixels[:, :, : 1 if channels < 3 else 3]
    return Image(colors, srgb=True, notes=png_notes(content))
