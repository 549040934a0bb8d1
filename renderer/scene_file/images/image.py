"""`Image`: pixels as in their file, and conversion of primaries to sRGB.

A colour space is given by its primaries and white as points x, y of the CIE 1931 diagram:
eight numbers for red, green, blue and white, x before y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError

BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # equal to those of sRGB
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)


def differ(one: Sequence[float], other: Sequence[float], at_least: float) -> bool:
    """Return whether the summed difference of two colour spaces is at least `at_least`.

    NaN counts as different.
    """
    distance = np.linalg.norm(np.subtract(one, other, dtype=np.float64))
    return not distance < at_least


def srgb_from(points: Sequence[float]) -> NDArray[np.float32]:
    """Return the matrix, (3, 3), from a colour space to linear sRGB.

    White keeps its XYZ: as in OpenEXR and Mitsuba, there is no chromatic adaptation. All
    entries are NaN or infinite if the primaries are collinear.
    """
    with np.errstate(all="ignore"):
        try:
            matrix = np.linalg.inv(_xyz_from(BT709)) @ _xyz_from(points)
        except np.linalg.LinAlgError:
            return np.full((3, 3), np.nan, np.float32)
        return matrix.astype(np.float32)


def _xyz_from(points: Sequence[float]) -> NDArray[np.float64]:
    """Return the matrix to XYZ: its columns are scaled primaries, their sum is white."""
    x, y = np.asarray(points, np.float64).reshape(4, 2).T
    columns = np.stack([x, y, 1.0 - x - y])  # normalised to X + Y + Z = 1
    white = columns[:, 3] / y[3]
    return np.asarray(columns[:, :3] * np.linalg.solve(columns[:, :3], white))


# -------------------------------------------------------------------------------- image
# Image: pixels in the format of their file, and their conversion to linear light.

# Linear sRGB (ITU-R BT.709 primaries, D65) from XYZ, rounded as in Mitsuba.
SRGB_FROM_XYZ = np.array(
    [
        [3.240479, -1.537150, -0.498535],
        [-0.969256, 1.875991, 0.041556],
        [0.055648, -0.204043, 1.057311],
    ]
)


@dataclass(frozen=True, eq=False)
class Image:
    """Pixels without alpha, row 0 at the top."""

    texels: NDArray[Any]  # (H, W, 1 or 3) uint8, uint16, float16 or float32
    srgb: bool = False  # whether they are sRGB encoded; in files only integers are
    notes: tuple[str, ...] = ()  # for the log: entries of the file that are not applied

    @property
    def linear(self) -> NDArray[np.float32]:
        """The pixels as linear RGB, (H, W, 3)."""
        values = linear_values(self.texels, self.srgb)
        color = np.broadcast_to(values, (*values.shape[:2], 3))
        return np.ascontiguousarray(color, dtype=np.float32)


def linear_from_srgb(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Undo the transfer curve of sRGB (IEC 61966-2-1); both ends in [0, 1]."""
    # The power of a negative base never reaches the result, but would warn.
    curve = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, curve)


def linear_values(texels: NDArray[Any], srgb: bool) -> NDArray[np.floating]:
    """Return linear values of texels: integers scaled to [0, 1], decoded if `srgb`."""
    if texels.dtype.kind == "f":
        return linear_from_srgb(texels).astype(texels.dtype) if srgb else texels
    if texels.dtype == np.uint8:
        return decoded_bytes(srgb, np.float64)[texels]
    encoded = texels / 65535.0
    return linear_from_srgb(encoded) if srgb else encoded


def decoded_bytes(srgb: bool, dtype: Any = np.float32) -> NDArray[Any]:
    """Return the linear value of each of the 256 bytes."""
    encoded = np.arange(256) / 255.0
    return (linear_from_srgb(encoded) if srgb else encoded).astype(dtype)


def checked(image: Image, name: str) -> Image:
    """Return an image with one or three channels, without alpha.

    Raises
    ------
    SceneError
        If it has other channels, no pixels, or values that are NaN or infinite. (Mitsuba
        renders such pixels; they make everything NaN that their light reaches.)
    """
    texels = image.texels
    if texels.ndim != 3 or texels.shape[2] not in (1, 2, 3, 4) or texels.size == 0:
        raise SceneError(
            f"{name}: the image has the shape {texels.shape}; expected (height, width, "
            "channels) with 1 to 4 channels"
        )
    if texels.shape[2] in (2, 4):
        texels = texels[:, :, :-1]
    if texels.dtype.kind == "f" and not (finite := np.isfinite(texels).all(axis=2)).all():
        row, column = np.argwhere(~finite)[0]
        raise SceneError(
            f"{name}: the image has NaN or infinite pixels, "
            f"{finite.size - finite.sum()} of {finite.size}; the first is in row {row}, "
            f"column {column}"
        )
    return Image(np.ascontiguousarray(texels), image.srgb, image.notes)


def negative_pixels(texels: NDArray[Any]) -> str | None:
    """Return the number of pixels with negative values and the minimum; None if none."""
    if texels.dtype.kind != "f" or not (least := texels.min()) < 0.0:
        return None
    count = np.count_nonzero((texels < 0.0).any(axis=2))
    there = texels.shape[0] * texels.shape[1]
    return f"{count} of {there} pixels are negative, down to {least:g}"
