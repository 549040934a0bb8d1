"""Reads EXR files as linear RGB or grey, with OpenEXR.

As in Mitsuba: which channels are colours, their common type, and the conversion by the
attribute `chromaticities`.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.images.image import (
    BT709,
    SRGB_FROM_XYZ,
    XYZ,
    Image,
    differ,
    srgb_from,
)

_MAGIC = b"\x76\x2f\x31\x01"
# Largest expansion of a byte of the file, for methods where it is bounded.
_MOST_EXPANSION = {"NO": 1, "RLE": 64, "ZIPS": 1032, "ZIP": 1032, "PXR24": 1376}
_BYTES_A_NUMBER = 12  # read, stacked, and converted to other primaries as float32
_LAYOUTS = ("rgb", "xyz", "y")  # each with or without "a"
_SAME_PRIMARIES = 1e-3  # root of the sum of squares below which Mitsuba does not convert
_COLOR_SPACES = ("colorInteropID", "oiio:ColorSpace")
# Attributes about the meaning of the numbers that Mitsuba ignores.
_NOT_APPLIED = (
    *("whiteLuminance", "adoptedNeutral", "renderingTransform", "lookModTransform"),
    *_COLOR_SPACES,
)
_LINEAR_SRGB = {"linear", "scene_linear", "lin_srgb", "lin_rec709", "lin_rec709_scene"}


def is_exr(path: Path) -> bool:
    """Return whether a file starts like an EXR file."""
    with path.open("rb") as file:
        return file.read(4) == _MAGIC


@contextmanager
def without_lines_of_openexr() -> Iterator[None]:
    """Suppress OpenEXR's messages about a damaged file; the error here is one line."""
    with ExitStack() as stack:
        stack.enter_context(redirect_stdout(io.StringIO()))
        with suppress(OSError):  # its C code writes to a stream that may be closed
            kept = os.dup(2)
            stack.callback(os.close, kept)
            stack.callback(os.dup2, kept, 2)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, nowhere)
            os.dup2(nowhere, 2)
        yield


def read_exr(path: Path) -> Image:
    """Read the colours of the first part of an EXR file.

    Returns
    -------
    image
        Linear sRGB or grey; half floats if the first of the channels, by name, has them.

    Raises
    ------
    SceneError
        If it is damaged, its channels are not RGB[A], Y[A] or XYZ[A] in upper or lower
        case, or its chromaticities are not those of a colour space.
    """
    import OpenEXR  # here, because its import takes 0.1 s and not all scenes need it

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            headers = [dict(part.header) for part in file.parts]  # valid while it is open
            _check_size(path, headers)
            _check_kind(path, headers[0])
        with (
            without_lines_of_openexr(),
            OpenEXR.File(str(path), separate_channels=True) as file,
        ):
            if not file.parts:
                raise SceneError(f"{path}: damaged EXR file: its pixels cannot be read")
            channels = {
                name: np.asarray(channel.pixels)
                for name, channel in file.channels().items()
            }
        return Image(_pixels(path, channels, headers[0]), notes=_notes(headers))
    except SceneError:  # also a ValueError
        raise
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        first_line = (str(error).splitlines() or ["unknown reason"])[0]
        raise SceneError(f"{path}: damaged EXR file: {first_line}") from None


def _pixels(
    path: Path, channels: dict[str, NDArray[Any]], header: dict[str, Any]
) -> NDArray[np.float16 | np.float32]:
    """Return (H, W, 1 or 3) linear sRGB or grey."""
    layout, names = _colors(path, channels)
    first = channels[min(channels)].dtype
    if first == np.uint32 and any(channels[name].dtype != first for name in names):
        raise SceneError(
            f"{path}: the first channel of the EXR file, {min(channels)}, has whole "
            "numbers and its colours have not; expected one type of all channels"
        )
    points = header.get("chromaticities")
    if first == np.uint32 and points and differ(points, BT709, _SAME_PRIMARIES):
        raise SceneError(
            f"{path}: the EXR file has whole numbers and chromaticities of its own, which "
            "Mitsuba converts wrongly; expected floats"
        )
    kept = np.float16 if first == np.float16 else np.float32
    with np.errstate(over="ignore"):  # infinite values are reported later
        pixels = np.stack([channels[name] for name in names], axis=-1)
        pixels = pixels.astype(kept, copy=False)
        return _as_srgb(path, pixels, layout, points)


def _colors(path: Path, channels: dict[str, NDArray[Any]]) -> tuple[str, list[str]]:
    """Return the kind of colours ("rgb", "xyz" or "y"), and their channels."""
    names = {name.rpartition(".")[2].lower(): name for name in channels}  # "layer.R" -> r
    layers = {name.rpartition(".")[0] for name in channels}
    if len(names) == len(channels) and len(layers) == 1:
        for layout in _LAYOUTS:
            if names.keys() - {"a"} == set(layout):
                return layout, [names[letter] for letter in layout]
    raise SceneError(
        f"{path}: the EXR file has the channels {', '.join(sorted(channels)) or 'none'}; "
        "expected R, G, B or Y or X, Y, Z (and A) of one layer"
    )


def _as_srgb(
    path: Path,
    pixels: NDArray[Any],
    layout: str,
    chromaticities: tuple[float, ...] | None,
) -> NDArray[Any]:
    """Return colours with the primaries of the file as linear sRGB."""
    matrix = SRGB_FROM_XYZ if layout == "xyz" else None
    if layout == "rgb" and chromaticities is not None:
        if not differ(chromaticities, BT709, _SAME_PRIMARIES):
            return pixels
        matrix = SRGB_FROM_XYZ
        if differ(chromaticities, XYZ, _SAME_PRIMARIES):
            matrix = srgb_from(chromaticities)
    if matrix is None:
        return pixels
    if not np.isfinite(matrix).all():
        shown = ", ".join(f"{number:g}" for number in chromaticities or ())
        raise SceneError(
            f"{path}: the EXR attribute chromaticities ({shown}) is of no colour space; "
            "expected red, green, blue and white as points x, y, not on one line"
        )
    single = pixels.astype(np.float32, copy=False)
    matrix = matrix.astype(np.float32)
    return (single @ matrix.T).astype(pixels.dtype, copy=False)


def _notes(headers: list[dict[str, Any]]) -> tuple[str, ...]:
    """Return notes about attributes that are not applied."""
    header, notes = headers[0], []
    for name in _NOT_APPLIED:
        value = header.get(name)
        if isinstance(value, bytes):
            value = value.decode("latin-1")
        if value is None or (isinstance(value, str) and not value):
            continue
        if name in _COLOR_SPACES and (
            # numerical primaries are applied
            "chromaticities" in header or str(value).lower() in _LINEAR_SRGB
        ):
            continue
        if isinstance(value, str):
            shown = value[:40]
        else:
            shown = ", ".join(f"{number:g}" for number in np.ravel(value))
        notes.append(f"the EXR attribute {name} ({shown}) is not applied, as in Mitsuba")
    if header.get("envmap"):  # 0 is the latitude-longitude layout
        notes.append(
            "the EXR attribute envmap says that it shows the faces of a cube; it is taken "
            "as one picture, as in Mitsuba"
        )
    if abs(header.get("pixelAspectRatio", 1.0) - 1.0) > 1e-3:
        notes.append(
            f"the EXR attribute pixelAspectRatio ({header['pixelAspectRatio']:g}) is not "
            "applied, as in Mitsuba"
        )
    if not np.array_equal(header["dataWindow"], header["displayWindow"]):
        notes.append(
            "the EXR attribute displayWindow is not the dataWindow; the pixels that are "
            "there are taken as the whole picture, as in Mitsuba"
        )
    if len(headers) > 1:
        notes.append(f"the EXR file has {len(headers)} parts; the first is read")
    return tuple(notes)


def _check_kind(path: Path, header: dict[str, Any]) -> None:
    """Refuse deep pixels, and subsampled channels."""
    kind = getattr(header.get("type"), "name", "scanlineimage")
    if kind not in ("scanlineimage", "tiledimage"):
        raise SceneError(f"{path}: the EXR file is a {kind}; expected one without depth")
    for channel in header["channels"]:
        if (channel.xSampling, channel.ySampling) != (1, 1):
            raise SceneError(
                f"{path}: the EXR channel {channel.name} has fewer pixels than the "
                "picture, as with luminance and chroma; expected one number a pixel"
            )


def _check_size(path: Path, headers: list[dict[str, Any]]) -> None:
    """Refuse headers with more pixels than the file can hold, or than fit into memory.

    Raises
    ------
    SceneError
        Otherwise OpenEXR would print a line about each missing block.
    """
    promised = {"NO": 0}  # bytes of pixels by the name of their compression
    numbers = 0
    for header in headers:
        low, high = header["dataWindow"]
        width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
        method = header["compression"].name.removesuffix("_COMPRESSION")
        for channel in header["channels"]:
            values = width * height // (channel.xSampling * channel.ySampling)
            # as half floats: the library does not know the type before it reads the pixels
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
