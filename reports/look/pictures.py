"""From linear radiance to what an HTML page can show: tone map, difference, data URI.

Both sides of a comparison go through the same curve at the same exposure, so that what
looks different is different. A value that is not finite is magenta everywhere.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.picture.picture import srgb_from_linear
from reports.errors import ReportError

Picture = NDArray[np.float32]  # (H, W, 3), linear sRGB
Difference = NDArray[np.float64]  # (H, W), signed luminance

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (Rec. 709)
NOT_FINITE = (255, 0, 255)

# Blue to orange through near white: told apart with every common colour blindness.
DIVERGING = np.array(
    [
        [8, 48, 107],
        [33, 113, 181],
        [158, 202, 225],
        [247, 247, 247],
        [253, 190, 133],
        [217, 95, 14],
        [127, 39, 4],
    ],
    dtype=np.float64,
)
DIVERGING_STEPS = 255  # odd: the middle step is exactly zero
_NOT_FINITE_STEP = 255


def load_picture(path: Path) -> Picture:
    """Read a float image of shape (H, W, 3) from a .npy file.

    Raises
    ------
    ReportError
        If the file is missing or holds anything else.
    """
    pixels = load_array(path)
    shape = getattr(pixels, "shape", None)
    if shape is None or len(shape) != 3 or shape[2] != 3 or 0 in shape:
        raise ReportError(f"{path}: expected an image of shape (H, W, 3), found {shape}")
    return np.asarray(pixels, dtype=np.float32)


def load_array(path: Path) -> Any:
    """Read what a .npy file holds.

    Raises
    ------
    ReportError
        If the file is missing or is something else.
    """
    try:
        return np.load(path, allow_pickle=False)
    except OSError as error:
        reason = error.strerror or "not a .npy file"
        raise ReportError(f"{path}: image cannot be read: {reason}") from None
    except (ValueError, EOFError):
        raise ReportError(f"{path}: image cannot be read: not a .npy file") from None


def exposure_stops(reference: Picture) -> int:
    """Return the whole number of stops that brings a picture's light parts near 0.5.

    The 90 % quantile of luminance decides, not the maximum: a lamp in view would turn the
    room black.
    """
    luminance = reference.astype(np.float64) @ LUMINANCE
    finite = luminance[np.isfinite(luminance)]
    bright = float(np.quantile(finite, 0.9)) if finite.size else 0.0
    return round(math.log2(0.5 / bright)) if bright > 0.0 else 0


def tone_mapped(pixels: Picture, stops: int) -> NDArray[np.uint8]:
    """Scale linear sRGB by 2^stops, clip to [0, 1], apply the sRGB curve; to bytes."""
    finite: NDArray[np.bool_] = np.all(np.isfinite(pixels), axis=2)
    exposed = np.where(finite[..., None], pixels, 0.0) * np.float64(2.0) ** stops
    shown = np.round(srgb_from_linear(exposed) * 255.0).astype(np.uint8)
    shown[~finite] = NOT_FINITE
    return shown


def signed_difference(ours: Picture, reference: Picture) -> Difference:
    """Return ours minus reference in luminance, shape (H, W).

    Where either picture is not finite, the difference is not finite.

    Raises
    ------
    ReportError
        If the two pictures have different sizes.
    """
    if ours.shape != reference.shape:
        shapes = f"{ours.shape} and {reference.shape}"
        raise ReportError(f"pictures of shapes {shapes} do not match")
    with np.errstate(invalid="ignore"):  # Inf - Inf is NaN, which is what is wanted
        difference = ours.astype(np.float64) - reference.astype(np.float64)
        return np.asarray(difference @ LUMINANCE)


def symmetric_scale(*differences: Difference) -> float:
    """Return a round number s so that 99 % of all values lie in [-s, s].

    Round means 1, 2 or 5 times a power of ten. A few fireflies do not decide the scale.
    """
    sizes = np.abs(np.concatenate([difference.ravel() for difference in differences]))
    sizes = sizes[np.isfinite(sizes)]
    wanted = float(np.quantile(sizes, 0.99)) if sizes.size else 0.0
    if wanted <= 0.0:
        wanted = float(sizes.max()) if sizes.size else 0.0
    if wanted <= 0.0:
        return 1e-6  # identical pictures: any scale shows them as zero
    power = math.floor(math.log10(wanted))
    rounds = [float(f"{step}e{power}") for step in (1, 2, 5, 10)]
    return next(scale for scale in rounds if scale >= wanted * (1.0 - 1e-9))


def diverging_steps(difference: Difference, scale: float) -> NDArray[np.uint8]:
    """Quantise [-scale, scale] to the steps 0..254 of the colour map; 255 is not finite."""
    finite = np.isfinite(difference)
    position = np.clip(np.where(finite, difference, 0.0) / scale, -1.0, 1.0)
    steps = np.round((position + 1.0) / 2.0 * (DIVERGING_STEPS - 1)).astype(np.uint8)
    steps[~finite] = _NOT_FINITE_STEP
    return steps


def diverging_palette() -> NDArray[np.uint8]:
    """Return the 255 colours from -scale to scale and, last, the one for not finite."""
    at = np.linspace(0.0, len(DIVERGING) - 1.0, DIVERGING_STEPS)
    knots = np.arange(len(DIVERGING))
    channels = [np.interp(at, knots, DIVERGING[:, channel]) for channel in range(3)]
    colours = np.round(np.stack(channels, axis=1))
    return np.vstack([colours, NOT_FINITE]).astype(np.uint8)


def difference_colours(difference: Difference, scale: float) -> NDArray[np.uint8]:
    """Return a signed difference of shape (H, W) as a picture in the diverging map."""
    return diverging_palette()[diverging_steps(difference, scale)]
