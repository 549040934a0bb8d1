"""Writes EXR, PNG and NPY files; an incomplete file never appears."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process.whole_file import is_stream, whole_file, why_not_writable
from renderer.rendering.picture.picture import Picture, srgb_from_linear

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

MAGENTA = np.array([255, 0, 255], dtype=np.uint8)  # marks pixels that are not finite

# How Mitsuba's `aov` integrator names the channels of each kind [run].
_SUFFIXES = {
    "albedo": "RGB",
    "depth": "T",
    "position": "XYZ",
    "uv": "UV",
    "geo_normal": "XYZ",
    "sh_normal": "XYZ",
    "prim_index": "I",
    "shape_index": "I",
    "color": "RGB",
    "xyz": "XYZ",
}
_SUFFIXES_BY_COUNT = {1: "Y", 2: "UV", 3: "XYZ", 4: "RGBA"}  # for other kinds


def aov_channel_names(name: str, kind: str, count: int) -> list[str]:
    """Return the channel names of an AOV, such as `["normals.X", "normals.Y", ...]`."""
    suffixes = _SUFFIXES.get(kind, "")
    if len(suffixes) != count:
        suffixes = _SUFFIXES_BY_COUNT.get(count, "")
    if not suffixes:
        return [f"{name}.{i}" for i in range(count)]
    return [f"{name}.{suffix}" for suffix in suffixes]


def _broken_pixels(pixels: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return (H, W), true where a channel is NaN or infinite."""
    return np.asarray(~np.isfinite(pixels).all(axis=2), dtype=np.bool_)


def encode_png(pixels: NDArray[np.float32]) -> PillowImage:
    """Return linear pixels (H, W, 3) as 8-bit sRGB; NaN and infinity become magenta."""
    from PIL import Image as pillow

    broken = _broken_pixels(pixels)
    encoded = srgb_from_linear(np.where(broken[..., None], 0.0, pixels))
    levels = np.floor(255.0 * encoded + 0.5).astype(np.uint8)
    levels[broken] = MAGENTA
    return pillow.fromarray(levels)


def exr_planes(image: Picture) -> dict[str, NDArray[np.float32]]:
    """Return the channels of an EXR file by name, (H, W) each."""
    planes = {name: image.pixels[..., c] for c, name in enumerate("RGB")}
    for name, values in image.aovs.items():
        kind = image.aov_kinds.get(name, "")
        for c, channel in enumerate(aov_channel_names(name, kind, values.shape[2])):
            planes[channel] = values[..., c]
    return {
        name: np.ascontiguousarray(values, dtype=np.float32)
        for name, values in planes.items()
    }


def exr_header(image: Picture) -> dict[str, Any]:
    """Return the header of an EXR file."""
    import OpenEXR  # here, because its import takes 0.1 s and PNG does not need it

    header: dict[str, Any] = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "spp": int(image.spp) if image.spp == int(image.spp) else float(image.spp),
    }
    header.update({key: str(value) for key, value in image.metadata.items()})
    return header


def _write_exr(file: BinaryIO, image: Picture) -> None:
    import OpenEXR

    # to an open file: given a name, OpenEXR reports no error when the last buffer fails
    OpenEXR.File(exr_header(image), exr_planes(image)).write(file)


def _write_png(file: BinaryIO, image: Picture) -> None:
    from PIL.PngImagePlugin import PngInfo

    broken = int(_broken_pixels(image.pixels).sum())
    if broken:
        warnings.warn(
            f"{broken} of {image.width * image.height} pixels are NaN or infinite "
            "and show as magenta",
            RuntimeWarning,
            stacklevel=4,  # the caller of Image.save
        )
    said = PngInfo()
    if "denoised" in image.metadata:
        said.add_text("Comment", f"denoised {image.metadata['denoised']}")
    encode_png(image.pixels).save(file, format="PNG", pnginfo=said)


def _write_npy(file: BinaryIO, image: Picture) -> None:
    pixels = np.ascontiguousarray(image.pixels, dtype=np.float32)
    header = np.lib.format.header_data_from_array_1_0(pixels)
    np.lib.format.write_array_header_1_0(file, header)
    file.write(pixels.data)  # `np.save` reports no error when the last buffer fails


_WRITERS = {".exr": _write_exr, ".png": _write_png, ".npy": _write_npy}


def check_output_path(path: Path) -> None:
    """Check before a render that `path` can be written.

    Raises
    ------
    SceneError
        If the extension is not .exr, .png or .npy, the folder is missing or not writable,
        or `path` is a folder or a read-only file.
    """
    if _ending(path) not in _WRITERS:
        found = f"the ending {path.suffix!r}" if path.suffix else "no ending"
        raise SceneError(f"{path}: {found}; pictures are written as .exr, .png or .npy")
    if (reason := why_not_writable(path)) is not None:
        raise SceneError(f"{path}: {reason}")


def _ending(path: Path) -> str:
    """Return the extension, which selects the format; a device without one gets EXR."""
    return path.suffix.lower() or (".exr" if is_stream(path) else "")


def write_image_file(path: Path, image: Picture) -> None:
    """Write `image` in the format of the extension of `path`; see `Image.save`."""
    check_output_path(path)
    try:
        with whole_file(path) as file:
            _WRITERS[_ending(path)](file, image)
    except (OSError, RuntimeError) as error:  # OpenEXR raises RuntimeError
        if isinstance(error, RuntimeWarning):  # a warning that the user's filter raises
            raise
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{path}: cannot be written: {reason}") from error
