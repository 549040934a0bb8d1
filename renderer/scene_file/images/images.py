"""Images for textures: PNG, JPEG and EXR as linear float32 RGB.

Alpha is dropped and grey becomes three equal channels, as in Mitsuba. Mitsuba keeps
16-bit images as half floats; the same rounding is applied here, so that both renderers
look up the same numbers.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.colors.spectra import linear_from_srgb
from renderer.scene_file.images.exr_image import is_exr, read_exr
from renderer.scene_file.images.png_16_bit import is_16_bit_png, read_16_bit_png

_LARGEST = 2**28  # pixels; beyond it a header is more likely broken than honest


def read_image(path: Path, *, raw: bool, storage: str = "auto") -> NDArray[np.float32]:
    """Read an image file.

    Parameters
    ----------
    path
        A PNG, JPEG or EXR file; its content counts, not its name.
    raw
        Take 8- and 16-bit values as they are instead of decoding them from sRGB.
    storage
        Mitsuba's `format`: "variant" keeps full floats, "fp16" rounds to half, "auto"
        rounds 16-bit integers only.

    Returns
    -------
    pixels
        (H, W, 3), row 0 at the top.

    Raises
    ------
    SceneError
        If the file is damaged, of another format, or has values that are negative, NaN
        or infinite.
    """
    pixels: NDArray[np.floating]
    rounds = storage == "fp16"
    try:
        if is_exr(path):
            pixels = read_exr(path)
        else:
            if is_16_bit_png(path):
                encoded = read_16_bit_png(path) / 65535.0
                rounds |= storage == "auto"
            else:
                encoded = _read_8_bit(path) / 255.0
            pixels = encoded if raw else linear_from_srgb(encoded)
    except OSError as error:
        raise SceneError(f"{path}: cannot read the image: {error.strerror}") from None
    if rounds:
        with np.errstate(over="ignore"):
            pixels = pixels.astype(np.float16)
    if not np.isfinite(pixels).all():
        raise SceneError(f"{path}: the image has NaN or infinite pixels")
    if pixels.min() < 0.0:
        raise SceneError(f"{path}: the image has negative pixels, down to {pixels.min():g}")
    color = np.broadcast_to(pixels, (*pixels.shape[:2], 3))
    return np.ascontiguousarray(color, dtype=np.float32)


def _read_8_bit(path: Path) -> NDArray[np.uint8]:
    """Return (H, W, 1 or 3) values of a PNG or JPEG that has at most 8 bits a channel."""
    # here, because scenes without images need not wait for it
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's, about sizes checked below
            with Image.open(path, formats=("PNG", "JPEG")) as image:
                if image.width * image.height > _LARGEST:
                    raise SceneError(
                        f"{path}: {image.width} x {image.height} pixels are too many; "
                        f"expected at most {_LARGEST}"
                    )
                if image.mode in ("1", "L", "LA"):
                    return np.asarray(image.convert("L"))[:, :, None]
                if image.mode in ("RGB", "RGBA", "P"):
                    # By way of RGBA, so that transparency of a palette is no black.
                    return np.asarray(image.convert("RGBA"))[:, :, :3]
                raise SceneError(
                    f"{path}: images of mode {image.mode} are not supported; "
                    "supported: grey, "
                    "grey + alpha, RGB, RGB + alpha, palette"
                )
    except UnidentifiedImageError:
        raise SceneError(
            f"{path}: neither PNG, JPEG nor EXR; textures are read from these formats"
        ) from None
    except (
        OSError,
        ValueError,
        SyntaxError,
        EOFError,
        Image.DecompressionBombError,
    ) as error:
        raise SceneError(f"{path}: damaged image: {error}") from None
