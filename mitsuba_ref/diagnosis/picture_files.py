"""Pictures of other programs, read as linear colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.diagnosis.image_mistakes import Floats
from renderer.command.compare_pictures import read_planes
from renderer.errors import SceneError
from renderer.scene_file.images.images import read_texels

CHANNELS = ("R", "G", "B"), ("r", "g", "b"), ("Y", "Y", "Y"), ("0", "1", "2")


def read_picture(path: Path) -> tuple[Floats, tuple[str, ...]]:
    """Read a picture as (H, W, 3), linear sRGB, and notes about how it was read.

    EXR, NPY, HDR and PFM hold linear values. PNG, JPEG, BMP and TGA are decoded by the
    curve of sRGB.

    Raises
    ------
    SceneError
        One line: the file, what was found, what is possible.
    """
    notes: tuple[str, ...] = ()
    if not path.is_file():
        raise SceneError(f"{path}: no such picture")
    if path.suffix.lower() in (".exr", ".npy"):
        pixels = _colours(path, read_planes(path))
    else:
        image = read_texels(path)
        pixels = np.asarray(image.linear, dtype=np.float64)
        bits = 8 * image.texels.dtype.itemsize
        if image.texels.dtype.kind == "u":
            notes = (
                f"{path.name} has {bits} bits a channel: it was decoded by the curve of "
                f"sRGB; values above 1 are lost, and steps of 1/{2**bits - 1} count as "
                "noise",
            )
    if not (finite := np.isfinite(pixels).all(axis=2)).all():
        y, x = np.argwhere(~finite)[0]
        raise SceneError(
            f"{path}: {np.sum(~finite)} pixels are NaN or infinite, the first at x = {x}, "
            f"y = {y}; only finite ones can be compared"
        )
    return pixels, notes


def _colours(path: Path, planes: dict[str, NDArray[np.generic]]) -> Floats:
    """Return the colours among the channels of a file, (H, W, 3)."""
    for names in CHANNELS:
        if set(names) <= planes.keys():
            colours = [np.asarray(planes[name], dtype=np.float64) for name in names]
            return np.stack(colours, axis=-1)
    found = ", ".join(sorted(planes))
    raise SceneError(f"{path}: the channels {found}; R, G, B or Y are possible")
