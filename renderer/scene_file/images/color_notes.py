"""Colour information of image files: chunks of PNG, ICC profiles."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.images.image import BT709, differ, linear_from_srgb

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

# --------------------------------------------------------------------------- png chunks
# Checks that a PNG has all rows of its header, which Pillow does not do.
#
# Pillow accepts a stream that ends early, but validly and with a whole row: the missing
# rows are black.

SIGNATURE = b"\x89PNG\r\n\x1a\n"
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type, 3 has a palette
DEFLATE_RATIO = 1032  # largest number of bytes that one byte of a stream expands to
HEAD = 29  # [bytes] of signature and header
_PIECE = 1 << 16  # [bytes]
# first column and row of the seven passes of an interlaced image, and their steps
_PASSES = (
    *((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)),
    *((0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
)


def chunks(content: bytes, wanted: bytes) -> list[bytes]:
    """Return the chunks of one kind; a truncated chunk has its remaining bytes."""
    parts = []
    position = len(SIGNATURE)
    while position + 8 <= len(content):
        length, kind = struct.unpack_from(">I4s", content, position)
        if kind == wanted:
            parts.append(content[position + 8 : position + 8 + length])
        position += length + 12  # length, kind, checksum
    return parts


def image_data(content: bytes) -> bytes:
    """Join the IDAT chunks of a file."""
    return b"".join(chunks(content, b"IDAT"))


def size_of(content: bytes) -> tuple[int, int]:
    """Return width and height from the header."""
    width, height = struct.unpack_from(">II", content, 16)
    return width, height


def bytes_of_rows(content: bytes) -> int:
    """Return the number of bytes of all rows of the header, uncompressed.

    The caller has checked that the header is the first chunk.
    """
    width, height, depth, color_type, _, _, interlace = struct.unpack_from(
        ">IIBBBBB", content, 16
    )
    bits = depth * CHANNELS.get(color_type, 0)
    total = 0
    for x, y, step_x, step_y in _PASSES if interlace else ((0, 0, 1, 1),):
        columns, rows = -(-(width - x) // step_x), -(-(height - y) // step_y)
        if columns > 0 and rows > 0:
            total += rows * (1 + -(-columns * bits // 8))  # one byte for the filter
    return total


def bytes_held(content: bytes, at_most: int) -> int:
    """Return the number of bytes of rows in the file, up to `at_most`.

    Raises
    ------
    zlib.error, struct.error
        If the stream is damaged.
    """
    # without the two bytes of the zlib header, so that the checksum is not verified: Pillow
    # does not verify it either if all rows are there
    data, inflater, found = image_data(content)[2:], zlib.decompressobj(-15), 0
    for start in range(0, len(data), _PIECE):
        piece = data[start : start + _PIECE]
        while piece and found < at_most:
            found += len(inflater.decompress(piece, min(16 * _PIECE, at_most - found)))
            piece = inflater.unconsumed_tail
    return found


# -------------------------------------------------------------------------- icc profile
# Compares an ICC profile with sRGB.
#
# Only profiles with three primaries and curves, or with one curve for grey, are read;
# others, such as tables, count as different. Nothing is converted: Mitsuba takes pixels as
# sRGB, whatever their profile.

# sRGB's red, green and blue in XYZ under D50, as in its profiles.
_PRIMARIES = {
    b"rXYZ": (0.4361, 0.2225, 0.0139),
    b"gXYZ": (0.3851, 0.7169, 0.0971),
    b"bXYZ": (0.1431, 0.0606, 0.7141),
}
_CLOSE = 0.004  # difference of XYZ; sRGB profiles differ by less from each other
_SAME_CURVE = 0.01  # of linear light in [0, 1]; the power 2.2 differs by less
_HEADER = 128  # [bytes]
_POINTS = np.linspace(0.0, 1.0, 33)


def differs_from_srgb(profile: bytes) -> bool:
    """Return whether the colours of this profile differ from those of sRGB.

    Also true for a damaged profile.
    """
    try:
        (count,) = struct.unpack_from(">I", profile, _HEADER)
        tags = {}
        for i in range(min(count, 200)):
            name, at, size = struct.unpack_from(">4sII", profile, _HEADER + 4 + 12 * i)
            tags[name] = profile[at : at + size]
        if profile[16:20] == b"GRAY":
            return _curve_differs(tags[b"kTRC"])
        if b"A2B0" in tags:
            return True
        for name, expected in _PRIMARIES.items():
            found = np.array(struct.unpack_from(">3i", tags[name], 8)) / 65536.0
            if np.abs(found - expected).max() > _CLOSE:
                return True
        return any(_curve_differs(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC"))
    except (struct.error, KeyError, ValueError):
        return True


def _curve_differs(tag: bytes) -> bool:
    with np.errstate(all="ignore"):
        difference = np.abs(_curve(tag) - linear_from_srgb(_POINTS)).max()
    return not difference < _SAME_CURVE


def _curve(tag: bytes) -> NDArray[np.float64]:
    """Return the linear light for equally spaced values in [0, 1].

    Raises
    ------
    struct.error, ValueError
        If the curve is damaged or not supported.
    """
    kind, first = struct.unpack_from(">4s4xI", tag)
    if kind == b"curv" and first == 0:
        return _POINTS
    if kind == b"curv" and first == 1:
        (power,) = struct.unpack_from(">H", tag, 12)
        return np.asarray(_POINTS ** (power / 256.0))
    if kind == b"curv":
        table = np.frombuffer(tag, ">u2", first, 12) / 65535.0
        return np.interp(_POINTS, np.linspace(0.0, 1.0, first), table)
    if kind == b"para" and first >> 16 == 0:
        (power,) = struct.unpack_from(">i", tag, 12)
        return np.asarray(_POINTS ** (power / 65536.0))
    if kind == b"para" and first >> 16 == 3:  # a straight line below d
        power, a, b, c, d = np.array(struct.unpack_from(">5i", tag, 12)) / 65536.0
        return np.where(d <= _POINTS, (a * _POINTS + b) ** power, c * _POINTS)
    raise ValueError


# -------------------------------------------------------------------------- color notes
# Warnings about colour information of 8-bit image files, which Mitsuba ignores.
#
# PNG, JPEG, BMP and TGA pixels are taken as sRGB, in their stored order. Entries of the
# file that say otherwise (profiles, gamma, orientation) are logged.

_SRGB_GAMMA, _SAME_GAMMA = 1.0 / 2.2, 0.01
_SAME_PRIMARIES = 5e-3
_SRGB_CODE_POINTS = (1, 13, 0, 1)  # ITU-T H.273: primaries, transfer, matrix, full range
_LONGEST_PROFILE = 1 << 24  # [bytes]
_ORIENTATION, _EXIF, _COLOR_SPACE = 0x0112, 0x8769, 0xA001  # tags of EXIF
_ADOBE_RGB = 2
_WINDOWS_COLORS = (b"BGRs", b" niW")  # "sRGB" and "Win " as BMP files store them


def png_notes(content: bytes) -> tuple[str, ...]:
    """Return notes about the colour space of a PNG, by its most significant chunk."""
    instead = "is not applied, as in Mitsuba"
    if (found := _first(content, b"cICP")) is not None:
        code = tuple(found[:4])
        shown = ", ".join(map(str, code))
        return (
            () if code == _SRGB_CODE_POINTS else (f"the PNG chunk cICP {shown} {instead}",)
        )
    if (found := _first(content, b"iCCP")) is not None:
        name, _, packed = found.partition(b"\0")
        try:
            inflater = zlib.decompressobj()
            profile = inflater.decompress(packed[1:], _LONGEST_PROFILE)
        except zlib.error:
            profile = b""
        shown = name.decode("latin-1")[:40]
        differs = differs_from_srgb(profile)
        return (f'the PNG chunk iCCP, profile "{shown}", {instead}',) if differs else ()
    if _first(content, b"sRGB") is not None:
        return ()
    notes = []
    if (found := _first(content, b"gAMA")) is not None and len(found) == 4:
        gamma = struct.unpack(">I", found)[0] / 1e5
        if abs(gamma - _SRGB_GAMMA) > _SAME_GAMMA:
            notes.append(f"the PNG chunk gAMA {gamma:g} {instead}")
    if (found := _first(content, b"cHRM")) is not None and len(found) == 32:
        white_first = [number / 1e5 for number in struct.unpack(">8I", found)]
        points = (*white_first[2:], *white_first[:2])
        if differ(points, BT709, _SAME_PRIMARIES):
            shown = ", ".join(f"{number:g}" for number in white_first)
            notes.append(f"the PNG chunk cHRM {shown} {instead}")
    return tuple(notes)


def pillow_notes(path: Path, image: PillowImage) -> tuple[str, ...]:
    """Return notes about the colours of a file that Pillow has opened."""
    content = path.read_bytes()
    notes = []
    if image.format == "PNG":
        notes += [*png_notes(content), *_exif_notes(_first(content, b"eXIf") or b"")]
    if image.format in ("JPEG", "MPO"):
        profile = image.info.get("icc_profile")
        if profile and differs_from_srgb(profile):
            notes.append("the ICC profile of the JPEG is not applied, as in Mitsuba")
        notes += _exif_notes(image.info.get("exif") or b"")
    if image.format == "BMP":
        notes += _bmp_notes(content, image)
    if image.format == "TGA":
        notes += _tga_notes(content)
    return tuple(notes)


def _exif_notes(block: bytes) -> list[str]:
    from PIL.Image import Exif  # here, because scenes without images do not need it

    try:
        exif = Exif()
        exif.load(block)
        orientation = exif.get(_ORIENTATION, 1)
        color_space = exif.get_ifd(_EXIF).get(_COLOR_SPACE)
    except (struct.error, SyntaxError, ValueError, TypeError, KeyError, OSError):
        return []  # damaged metadata; the pixels may be valid
    notes = []
    if orientation in range(2, 9):
        notes.append(
            f"the EXIF orientation {orientation} is not applied, as in Mitsuba: the rows "
            "stay as they are stored"
        )
    if color_space == _ADOBE_RGB:
        notes.append("the EXIF colour space (Adobe RGB) is not applied, as in Mitsuba")
    return notes


def _bmp_notes(content: bytes, image: PillowImage) -> list[str]:
    notes = []
    if image.mode == "P" and content[28:30] == b"\x08\0":  # bits per pixel
        notes.append(
            "the palette of the BMP is applied; Mitsuba takes its indices as greys"
        )
    if content[28:30] == b"\x10\0":
        notes.append("the BMP has 16 bits a pixel; Mitsuba takes them as grey and alpha")
    (header,) = struct.unpack_from("<I", content, 14)
    if header >= 108 and content[70:74] not in _WINDOWS_COLORS:
        notes.append("the colour space of the BMP is not applied; it is taken as sRGB")
    return notes


def _tga_notes(content: bytes) -> list[str]:
    notes = []
    if len(content) > 17 and content[17] & 0x10:
        notes.append("the TGA is stored from right to left; Mitsuba shows it mirrored")
    if content[-18:-2] == b"TRUEVISION-XFILE":
        (extension,) = struct.unpack_from("<I", content, len(content) - 26)
        if 0 < extension and extension + 482 <= len(content):
            above, below = struct.unpack_from("<HH", content, extension + 478)
            if below and not (above == below or abs(above / below - 2.2) < 0.05):
                shown = f"{above / below:g}"
                notes.append(f"the gamma {shown} of the TGA is not applied, as in Mitsuba")
    return notes


def _first(content: bytes, kind: bytes) -> bytes | None:
    found = chunks(content, kind)
    return found[0] if found else None
