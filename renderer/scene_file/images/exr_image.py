"""EXR files as linear RGB or grey, by OpenEXR."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.images.image import SRGB_FROM_XYZ

_MAGIC = b"\x76\x2f\x31\x01"
# Bytes of pixels for a byte of the file, where a method cannot make more of it.
_MOST_EXPANSION = {"NO": 1, "RLE": 64, "ZIPS": 1032, "ZIP": 1032, "PXR24": 1376}
_BYTES_A_NUMBER = 16  # read, stacked, as float32, and turned from XYZ
_LAYOUTS = (("R", "G", "B"), ("X", "Y", "Z"), ("Y",))  # each with an A or without


def is_exr(path: Path) -> bool:
    """Tell whether a file starts as EXR files do."""
    with path.open("rb") as file:
        return file.read(4) == _MAGIC


def read_exr(path: Path) -> NDArray[np.float16 | np.float32]:
    """Read the colours of a one-part EXR file.

    Returns
    -------
    pixels
        (H, W, 3) linear sRGB, or (H, W, 1) if the file is grey; half floats if all of its
        colours are.

    Raises
    ------
    SceneError
        If it is damaged or its channels are not RGB[A], Y[A] or XYZ[A].
    """
    import OpenEXR  # here, because it takes 0.1 s that scenes without EXR need not wait

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            _check_size(path, [part.header for part in file.parts])
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {
                name: np.asarray(channel.pixels)
                for name, channel in file.channels().items()
            }
    except SceneError:  # a ValueError too
        raise
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        first_line = (str(error).splitlines() or ["unknown reason"])[0]
        raise SceneError(f"{path}: damaged EXR file: {first_line}") from None
    names = {name.rpartition(".")[2]: name for name in channels}  # "layer.R" -> R
    for layout in _LAYOUTS:
        if names.keys() - {"A"} == set(layout) and len(names) == len(channels):
            stacked = np.stack([channels[names[key]] for key in layout], axis=-1)
            kept = np.float16 if stacked.dtype == np.float16 else np.float32
            pixels = stacked.astype(np.float32)
            if layout[0] == "X":
                pixels = pixels @ SRGB_FROM_XYZ.T
            return pixels.astype(kept)
    raise SceneError(
        f"{path}: the EXR file has the channels {', '.join(sorted(channels)) or 'none'}; "
        "expected R, G, B or Y or X, Y, Z (and A)"
    )


def _check_size(path: Path, headers: list[dict[str, Any]]) -> None:
    """Refuse pixels that the file cannot hold, or the memory.

    Raises
    ------
    SceneError
        The library would otherwise write a line about each block that is missing.
    """
    promised = {"NO": 0}  # bytes of pixels by the name of their compression
    numbers = 0
    for header in headers:
        low, high = header["dataWindow"]
        width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
        method = header["compression"].name.removesuffix("_COMPRESSION")
        for channel in header["channels"]:
            values = width * height // (channel.xSampling * channel.ySampling)
            # of halves: the library tells no type before it has read the pixels
            promised[method] = promised.get(method, 0) + 2 * values
            numbers += values
    there = path.stat().st_size
    for method, size in promised.items():
        if size > there * _MOST_EXPANSION.get(method, size):
            raise SceneError(
                f"{path}: damaged EXR file: {there} bytes cannot hold the {size} of its "
                f"{method} pixels"
            )
    memory.require(_BYTES_A_NUMBER * numbers, f"{path}: the image")
