"""Warnings about colour information of 8-bit image files, which Mitsuba ignores.

PNG, JPEG, BMP and TGA pixels are taken as sRGB, in the order in which they are stored.
Entries of the file that say otherwise (profiles, gamma, orientation) are logged.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

from renderer.scene_file.images.icc_profile import differs_from_srgb
from renderer.scene_file.images.png_chunks import chunks
from renderer.scene_file.images.primaries import BT709, differ

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

_SRGB_GAMMA, _SAME_GAMMA = 1.0 / 2.2, 0.01
_SAME_PRIMARIES = 5e-3
_SRGB_CODE_POINTS = (1, 13, 0, 1)  # ITU-T H.273: primaries, transfer, matrix, full range
_LONGEST_PROFILE = 1 << 24  # [bytes]
_ORIENTATION, _EXIF, _COLOR_SPACE = 0x0112, 0x8769, 0xA001  # tags of EXIF
_ADOBE_RGB = 2
_WINDOWS_COLORS = (b"BGRs", b" niW")  # "sRGB" and "Win " as BMP files store them


def png_notes(content: bytes) -> tuple[str, ...]:
    """Return the colour space of a PNG, by the chunk that counts, if it is not sRGB."""
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
    """Return what a file that Pillow has opened says."""
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
    from PIL.Image import Exif  # here, because scenes without images need not wait for it

    try:
        exif = Exif()
        exif.load(block)
        orientation = exif.get(_ORIENTATION, 1)
        color_space = exif.get_ifd(_EXIF).get(_COLOR_SPACE)
    except (struct.error, SyntaxError, ValueError, TypeError, KeyError, OSError):
        return []  # damaged, which the pixels need not be
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
    if image.mode == "P" and content[28:30] == b"\x08\0":  # bits a pixel
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
