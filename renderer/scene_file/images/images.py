"""Reads images of all supported formats, for textures and environments.

The format is detected from the content and not from the name, except for TGA, which has no
signature.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.images.color_notes import (
    DEFLATE_RATIO,
    bytes_held,
    bytes_of_rows,
    chunks,
    pillow_notes,
    size_of,
)
from renderer.scene_file.images.exr_image import is_exr, read_exr
from renderer.scene_file.images.float_images import is_pfm, is_rgbe, read_pfm, read_rgbe
from renderer.scene_file.images.image import Image, checked
from renderer.scene_file.images.png_16_bit import is_16_bit_png, read_16_bit_png

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

READ_FROM = "PNG, JPEG, BMP, TGA, EXR, HDR or PFM"
_LARGEST = 2**28  # pixels; a header with more is probably damaged


def read_image(path: Path) -> NDArray[np.float32]:
    """Return the pixels of a file as linear RGB, (H, W, 3), row 0 at the top.

    Raises
    ------
    SceneError
        As `read_texels`.
    """
    return read_texels(path).linear


def read_texels(path: Path) -> Image:
    """Read an image file; alpha is dropped, without division of the colour by it.

    Raises
    ------
    SceneError
        If the file is damaged, has another format, or has values that are NaN or infinite.
    """
    try:
        if is_exr(path):
            image = read_exr(path)
        elif is_rgbe(path):
            image = read_rgbe(path, _LARGEST)
        elif is_pfm(path):
            image = Image(read_pfm(path, _LARGEST))
        elif is_16_bit_png(path):
            image = read_16_bit_png(path)
        else:
            image = _read_8_bit(path)
    except OSError as error:
        raise SceneError(f"{path}: cannot read the image: {error.strerror}") from None
    return checked(image, str(path))


def _read_8_bit(path: Path) -> Image:
    """Return an image with at most 8 bits per channel."""
    # here, because scenes without images do not need it
    from PIL import Image as Pillow
    from PIL import UnidentifiedImageError

    formats = ["PNG", "JPEG", "BMP"]
    if path.suffix.lower() == ".tga":
        formats.append("TGA")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's, about sizes checked below
            with Pillow.open(path, formats=formats) as image:
                if image.width * image.height > _LARGEST:
                    raise SceneError(
                        f"{path}: {image.width} x {image.height} pixels are too many; "
                        f"expected at most {_LARGEST}"
                    )
                pixels = image.width * image.height
                _require_content(path, image)
                grey = image.mode in ("1", "L", "LA")
                memory.require((6 if grey else 16) * pixels, f"{path}: the image")
                notes = pillow_notes(path, image)
                if image.format == "PNG":
                    _require_rows(path, image)
                if grey:
                    return Image(np.asarray(image.convert("L"))[:, :, None], True, notes)
                if image.mode in ("RGB", "RGBA", "P"):
                    # Converted to RGBA first, so that a transparent palette entry is not
                    # black.
                    return Image(np.asarray(image.convert("RGBA"))[:, :, :3], True, notes)
                raise SceneError(
                    f"{path}: images of mode {image.mode} are not supported; "
                    "supported: grey, "
                    "grey + alpha, RGB, RGB + alpha, palette"
                )
    except SceneError:  # also a ValueError
        raise
    except UnidentifiedImageError:
        raise SceneError(
            f"{path}: no image of a format that is read: {READ_FROM}"
        ) from None
    except (
        OSError,
        ValueError,
        SyntaxError,
        EOFError,
        IndexError,
        struct.error,
        zlib.error,
        MemoryError,  # a chunk of a PNG may claim 4 GB
        Pillow.DecompressionBombError,
    ) as error:
        shown = str(error) or "it claims more than fits into memory"
        raise SceneError(f"{path}: damaged image: {shown}") from None


def _require_content(path: Path, image: PillowImage) -> None:
    """Refuse a file that is too small for the size in its header."""
    size, pixels = path.stat().st_size, image.width * image.height
    # A JPEG needs at least a bit for 64 pixels; Pillow would invent missing ones.
    too_small = image.format == "JPEG" and pixels > 1024 * size
    if image.format == "PNG":
        content = path.read_bytes()
        if content[12:16] != b"IHDR" or size_of(content) != image.size:
            raise SceneError(f"{path}: damaged image: its first chunk is not its header")
        if len(chunks(content, b"IHDR")) != 1:  # Pillow uses the last one
            raise SceneError(f"{path}: damaged image: it has more than one header")
        too_small = bytes_of_rows(content) > DEFLATE_RATIO * size
    if too_small:
        raise SceneError(
            f"{path}: damaged image: {size} bytes cannot hold "
            f"{image.width} x {image.height} pixels"
        )


def _require_rows(path: Path, image: PillowImage) -> None:
    """Refuse a PNG with missing rows, which Pillow returns as black.

    Counting takes as long as reading, and is only done if the last row is black.
    """
    image.load()
    last = image.crop((0, image.height - 1, image.width, image.height))
    if image.info.get("interlace") or last.getbbox(alpha_only=False) is None:
        content = path.read_bytes()
        wanted = bytes_of_rows(content)
        if (held := bytes_held(content, wanted)) < wanted:
            raise SceneError(
                f"{path}: damaged image: {held} bytes of pixels; expected {wanted}"
            )
