"""PNG and EXR files, written by hand where a library would not write what a test needs."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR


def chunk(kind: bytes, data: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(kind + data))
    return struct.pack(">I", len(data)) + kind + data + check


def png_file(
    size: tuple[int, int],
    form: tuple[int, int],
    rows: bytes,
    *chunks: bytes,
    interlace: int = 0,
) -> bytes:
    """Return a PNG of a colour type and depth; `rows` begin with their filters."""
    color_type, depth = form
    header = struct.pack(">IIBBBBB", *size, depth, color_type, 0, 0, interlace)
    parts = (chunk(b"IHDR", header), *chunks, chunk(b"IDAT", zlib.compress(rows)))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IEND", b"")


def write_exr(path: Any, channels: dict[str, np.ndarray], **attributes: Any) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: np.ascontiguousarray(plane) for name, plane in channels.items()}
    # OpenEXR puts its own objects into the dictionary
    with OpenEXR.File({**header, **attributes}, planes) as file:
        file.write(str(path))
    return Path(path)
