"""A map of whole numbers as a short text, for a place in a JSON file."""

from __future__ import annotations

import base64
import zlib

import numpy as np
from numpy.typing import NDArray

MOST = 2**16 - 1


def packed(work: NDArray[np.int64]) -> str:
    """Return whole numbers as text: 16 bits each, little-endian, zlib, base64."""
    numbers = np.minimum(work, MOST).astype("<u2")
    return base64.b64encode(zlib.compress(numbers.tobytes(), 9)).decode("ascii")


def unpacked(text: str, width: int, height: int) -> NDArray[np.int64]:
    """Return the numbers of `packed`, (height, width).

    Raises
    ------
    ValueError
        If the text holds anything else.
    """
    try:
        content = zlib.decompress(base64.b64decode(text, validate=True))
    except (ValueError, zlib.error):
        raise ValueError("not a packed map of work") from None
    if len(content) != 2 * width * height:
        raise ValueError(f"holds {len(content) // 2} numbers, not {width} x {height}")
    return np.frombuffer(content, "<u2").astype(np.int64).reshape(height, width)
