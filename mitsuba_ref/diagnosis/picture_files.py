"""Pictures of other programs, read as linear colours."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.diagnosis.image_mistakes import Floats
from renderer.command.compare_pictures import read_planes
from renderer.errors import SceneError
from renderer.scene_file.images.image import SRGB_FROM_XYZ
from renderer.scene_file.images.images import read_texels

XYZ = ("X", "Y", "Z")
CHANNELS = ("R", "G", "B"), ("r", "g", "b"), XYZ, ("Y", "Y", "Y"), ("0", "1", "2")
WANTED = "linear values are expected, as floating-point numbers"


@dataclass(frozen=True, eq=False)
class PictureFile:
    """A picture (H, W, 3) in linear sRGB, and how it was read.

    `levels` is the largest integer of a channel; 0 in files of floating-point values.
    """

    pixels: Floats
    note: str = ""
    levels: int = 0


def read_picture(path: Path) -> PictureFile:
    """Read a picture.

    EXR, NPY, HDR and PFM hold linear values. PNG, BMP and TGA are decoded by the curve of
    sRGB. JPEG is refused, as its noise is not independent.

    Raises
    ------
    SceneError
        One line: the file, what was found, what is possible.
    """
    if not path.is_file():
        raise SceneError(f"{path}: no such picture")
    if path.suffix.lower() in (".exr", ".npy"):
        planes = read_planes(path)
        kind = next(iter(planes.values())).dtype.kind
        if path.suffix.lower() == ".npy" and kind in "iub":
            raise SceneError(f"{path} holds integers; {WANTED}")
        return PictureFile(_colours(path, planes))
    if path.suffix.lower() in (".jpg", ".jpeg"):
        raise SceneError(
            f"{path}: JPEG spreads the noise of a pixel over its neighbours, so that it "
            "looks like a difference; write PNG, EXR, HDR, PFM or NPY"
        )
    image = read_texels(path)
    pixels = np.asarray(image.linear, dtype=np.float64)
    if image.texels.dtype.kind != "u":
        return PictureFile(pixels)
    bits = 8 * image.texels.dtype.itemsize
    note = (
        f"Files of {bits} bits a channel are decoded by the curve of sRGB, and all other "
        "pictures are cut off at 1 and rounded as these were; both sides should have about "
        "the same noise, as cut-off noise has another mean"
    )
    return PictureFile(pixels, note, 2**bits - 1)


def _colours(path: Path, planes: dict[str, NDArray[np.generic]]) -> Floats:
    """Return the colours among the channels of a file, (H, W, 3).

    Layers come before a dot, as in `Combined.R`. Those without a layer go first.
    """
    # without a layer first, then the layer that Blender has all light in
    layers = sorted(
        {name.rpartition(".")[0] for name in planes},
        key=lambda layer: (layer != "", not layer.endswith("Combined"), layer),
    )
    for layer, names in itertools.product(layers, CHANNELS):
        full = [f"{layer}.{name}" if layer else name for name in names]
        if set(full) <= planes.keys():
            colours = np.stack([np.asarray(planes[n], np.float64) for n in full], axis=-1)
            return colours @ SRGB_FROM_XYZ.T if names == XYZ else colours
    found = ", ".join(sorted(planes))
    raise SceneError(f"{path}: the channels {found}; R, G, B or Y are possible")
