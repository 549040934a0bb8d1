"""Portable float maps (.pfm): a header of three lines, then float32, rows from the bottom.

The third line is a factor of all numbers, negative where these are little-endian.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory

_HEADER = re.compile(
    rb"P([Ff])\s+(\d{1,7})\s+(\d{1,7})\s+([+-]?[0-9.]{1,20}(?:[eE][+-]?\d{1,3})?)\s"
)
_LONGEST_HEADER = 128  # [bytes]


def is_pfm(path: Path) -> bool:
    """Tell whether a file starts as portable float maps do."""
    with path.open("rb") as file:
        return file.read(2) in (b"PF", b"Pf")


def read_pfm(path: Path, largest: int) -> NDArray[np.float32]:
    """Read the pixels, (H, W, 3), or (H, W, 1) of a grey one; row 0 at the top.

    Raises
    ------
    SceneError
        If the file is damaged or has more pixels than `largest`.
    """
    content = path.read_bytes()
    header = _HEADER.match(content, 0, _LONGEST_HEADER)
    if header is None:
        raise SceneError(
            f"{path}: damaged PFM file: expected PF or Pf, width, height and a factor"
        )
    channels = 3 if header[1] == b"F" else 1
    width, height = int(header[2]), int(header[3])
    if not 0 < width * height <= largest:
        raise SceneError(
            f"{path}: {width} x {height} pixels; expected at least 1 and at most {largest}"
        )
    try:
        factor = float(header[4])
    except ValueError:  # such as two points
        factor = 0.0
    if factor == 0.0 or not math.isfinite(factor):
        raise SceneError(
            f"{path}: damaged PFM file: the factor is {header[4].decode()}; expected a "
            "number other than 0"
        )
    count = channels * width * height
    if len(content) - header.end() < 4 * count:
        raise SceneError(
            f"{path}: damaged PFM file: {len(content) - header.end()} bytes for "
            f"{width} x {height} pixels"
        )
    memory.require(16 * count, f"{path}: the image")
    kind = np.dtype("<f4" if factor < 0.0 else ">f4")
    numbers = np.frombuffer(content, kind, count, header.end())
    rows = numbers.reshape(height, width, channels)[::-1].astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):  # refused where values are checked
        return rows * np.float32(abs(factor))
