"""PFM and RGBE (Radiance HDR) images."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.images.image import BT709, SRGB_FROM_XYZ, Image

# ---------------------------------------------------------------------------- pfm image
# Portable float maps (.pfm): a header of three lines, then float32, bottom row first.
#
# The third line is a scale factor, negative for little-endian numbers.

_HEADER = re.compile(
    rb"P([Ff])\s+(\d{1,7})\s+(\d{1,7})\s+([+-]?[0-9.]{1,20}(?:[eE][+-]?\d{1,3})?)\s"
)
_LONGEST_HEADER = 128  # [bytes]


def is_pfm(path: Path) -> bool:
    """Return whether a file starts like a portable float map."""
    with path.open("rb") as file:
        return file.read(2) in (b"PF", b"Pf")


def read_pfm(path: Path, largest: int) -> NDArray[np.float32]:
    """Read the pixels, (H, W, 3), or (H, W, 1) of a grey image; row 0 at the top.

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
    except ValueError:  # such as two decimal points
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
    with np.errstate(over="ignore", invalid="ignore"):  # values are checked later
        return rows * np.float32(abs(factor))


# --------------------------------------------------------------------------- rgbe image
# Radiance pictures (.hdr, .rgbe, .xyze) as linear RGB [Ward1991].
#
# Three mantissas of a byte share the exponent in a fourth byte. Rows of 8 to 32767 pixels
# may be run-length encoded: each of the four bytes of all pixels separately.

_SIZE = re.compile(rb"-Y (\d{1,7}) \+X (\d{1,7})")
_LONGEST_RGBE_HEADER = 1 << 16  # [bytes]
_PACKED = range(8, 32768)  # widths of rows that may be run-length encoded
_FORMATS = (b"32-bit_rle_rgbe", b"32-bit_rle_xyze")
# Variables of the header about the meaning of the numbers: values that change nothing.
_NOT_APPLIED = {
    "EXPOSURE": (1.0,),
    "COLORCORR": (1.0, 1.0, 1.0),
    "GAMMA": (1.0,),
    "PRIMARIES": BT709,
    "PIXASPECT": (1.0,),
}
_SAME = 2e-3  # relative difference of header values that counts as rounding


def is_rgbe(path: Path) -> bool:
    """Return whether a file starts like a Radiance picture."""
    with path.open("rb") as file:
        return file.read(2) == b"#?"


def read_rgbe(path: Path, largest: int) -> Image:
    """Read the pixels, (H, W, 3) linear sRGB, row 0 at the top.

    Exposure, gamma and primaries of the header are not applied, as in Mitsuba, but noted.

    Raises
    ------
    SceneError
        If the file is damaged, has more pixels than `largest`, or another order of rows.
    """
    content = path.read_bytes()
    end = content.find(b"\n\n", 0, _LONGEST_RGBE_HEADER)
    if end < 0:
        raise SceneError(f"{path}: damaged HDR file: its header does not end")
    lines = content[:end].split(b"\n")
    formats = [line[7:].strip() for line in lines if line.startswith(b"FORMAT=")]
    if formats and formats[-1] not in _FORMATS:
        shown = formats[-1].decode("latin-1")[:40]
        raise SceneError(
            f"{path}: HDR files of format {shown!r} are not supported; "
            "supported: 32-bit_rle_rgbe, 32-bit_rle_xyze"
        )
    start = content.find(b"\n", end + 2, end + 64) + 1
    size = _SIZE.fullmatch(content[end + 2 : start - 1]) if start else None
    if size is None:
        raise SceneError(
            f"{path}: the HDR file says no size `-Y HEIGHT +X WIDTH` (rows from the top) "
            "after its header"
        )
    height, width = (int(number) for number in size.groups())
    if not 0 < height * width <= largest:
        raise SceneError(
            f"{path}: {width} x {height} pixels; expected at least 1 and at most {largest}"
        )
    # checked before memory is allocated: an encoded row has at least its start and two
    # bytes for each run of 127
    row_at_least = 4 * width
    if width in _PACKED and content[start : start + 2] == b"\2\2":
        row_at_least = 4 + 8 * -(-width // 127)
    if len(content) - start < height * row_at_least:
        runs = ", or one with runs of the old kind" if b"\1\1\1" in content[start:] else ""
        raise SceneError(
            f"{path}: damaged HDR file{runs}: {len(content) - start} bytes for {height} "
            f"rows of {width} pixels"
        )
    memory.require(44 * height * width, f"{path}: the image")
    pixels = _decoded(_pixels(content, start, width, height, path))
    if formats and formats[-1] == b"32-bit_rle_xyze":
        pixels = np.asarray(pixels @ SRGB_FROM_XYZ.astype(np.float32).T)
    return Image(pixels, notes=_notes(lines))


def _notes(lines: list[bytes]) -> tuple[str, ...]:
    """Return notes about the header's entries that are not applied."""
    notes = []
    for name, nothing in _NOT_APPLIED.items():
        prefix = name.encode() + b"="
        texts = [line[len(prefix) :] for line in lines if line.startswith(prefix)]
        found = [_numbers(text) for text in texts]
        total = nothing
        if name != "PRIMARIES" and all(len(row) == len(nothing) for row in found):
            total = tuple(np.prod([nothing, *found], axis=0))  # several lines multiply
        elif found:
            total = found[-1]
        if len(total) != len(nothing) or not np.allclose(total, nothing, atol=_SAME):
            shown = b", ".join(texts).decode("latin-1")[:80]
            notes.append(f"{name}={shown} of the HDR file is not applied, as in Mitsuba")
    return tuple(notes)


def _numbers(text: bytes) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split())
    except ValueError:
        return ()


def _pixels(
    content: bytes, at: int, width: int, height: int, path: Path
) -> NDArray[np.uint8]:
    """Return the four bytes of each pixel, (H, W, 4)."""
    pixels = np.empty((height, width, 4), np.uint8)
    packed = bytes((2, 2, width >> 8, width & 255))
    for y in range(height):
        if width in _PACKED and content[at : at + 4] == packed:
            at += 4
            for component in range(4):
                row, at = _unpacked(content, at, width, y, path)
                pixels[y, :, component] = np.frombuffer(row, np.uint8)
            continue
        plain = content[at : at + 4 * width]
        if len(plain) < 4 * width:
            raise SceneError(f"{path}: damaged HDR file: it ends in row {y}")
        pixels[y] = np.frombuffer(plain, np.uint8).reshape(width, 4)
        at += 4 * width
    return pixels


def _unpacked(
    content: bytes, at: int, width: int, y: int, path: Path
) -> tuple[bytearray, int]:
    """Return one component of a row, and the position of the next one."""
    row = bytearray()
    while len(row) < width:
        count = content[at] if at < len(content) else 0
        if count > 128:
            piece, size = content[at + 1 : at + 2] * (count - 128), 2
        else:
            piece, size = content[at + 1 : at + 1 + count], 1 + count
        if not piece or at + size > len(content) or len(row) + len(piece) > width:
            raise SceneError(f"{path}: damaged HDR file: row {y} cannot be unpacked")
        row += piece
        at += size
    return row, at


def _decoded(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return mantissas times 2^(exponent - 136); an exponent of 0 is black."""
    exponent = pixels[:, :, 3:].astype(np.int32)
    values = np.ldexp(pixels[:, :, :3].astype(np.float32), exponent - 136)
    return np.where(exponent == 0, np.float32(0.0), values)
