"""Images of all formats that are read, for textures and environments.

What a file is, its content says and not its name, but for TGA, which has no signature.
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
_LARGEST = 2**28  # pixels; beyond it a header is more likely broken than honest


def read_image(path: Path) -> NDArray[np.float32]:
    """Return the pixels of a file as linear RGB, (H, W, 3), row 0 at the top.

    Raises
    ------
    SceneError
        As `read_texels`.
    """
    return read_texels(path).linear


def read_texels(path: Path) -> Image:
    """Read an image file; alpha is dropped, and the colour not divided by it.

    Raises
    ------
    SceneError
        If the file is damaged, of another format, or has values that are NaN or infinite.
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
    """Return an image that has at most 8 bits a channel."""
    # here, because scenes without images need not wait for it
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
                    # By way of RGBA, so that transparency of a palette is no black.
                    return Image(np.asarray(image.convert("RGBA"))[:, :, :3], True, notes)
                raise SceneError(
                    f"{path}: images of mode {image.mode} are not supported; "
                    "supported: grey, "
                    "grey + alpha, RGB, RGB + alpha, palette"
                )
    except SceneError:  # a ValueError too
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
    """Refuse a file that is too small for what its header promises."""
    size, pixels = path.stat().st_size, image.width * image.height
    # A coder spends a bit on 64 pixels at least; missing ones are made up.
    too_small = image.format == "JPEG" and pixels > 1024 * size
    if image.format == "PNG":
        content = path.read_bytes()
        if content[12:16] != b"IHDR" or size_of(content) != image.size:
            raise SceneError(f"{path}: damaged image: its first chunk is not its header")
        if len(chunks(content, b"IHDR")) != 1:  # Pillow takes the last
            raise SceneError(f"{path}: damaged image: it has more than one header")
        too_small = bytes_of_rows(content) > DEFLATE_RATIO * size
    if too_small:
        raise SceneError(
            f"{path}: damaged image: {size} bytes cannot hold "
            f"{image.width} x {image.height} pixels"
        )


def _require_rows(path: Path, image: PillowImage) -> None:
    """Refuse a PNG that holds less than all rows; those that lack are black.

    Counting takes as long as reading, and is needed only where the last row is black.
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
