"""Linear pictures as bytes for a screen, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.picture.picture import srgb_from_linear

GAP = 4  # [pixels] of white between two pictures


def on_screen(
    pictures: Sequence[NDArray[np.floating]], *, exposure: float = 1.0, enlarged: int = 2
) -> NDArray[np.uint8]:
    """Return the pictures from left to right as sRGB bytes, (height, width, 3).

    Parameters
    ----------
    pictures
        Linear, of the same height, (H, W, 3) or grey (H, W).
    exposure
        That they are multiplied by; 1 is white then.
    enlarged
        How many pixels of the screen a pixel has each way.
    """
    columns: list[NDArray[np.floating]] = []
    for picture in pictures:
        color = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
        columns += [color * exposure, np.ones((color.shape[0], GAP, 3))]
    shown = srgb_from_linear(np.concatenate(columns[:-1], axis=1))
    bytes_ = np.round(shown * 255.0).astype(np.uint8)
    return bytes_.repeat(enlarged, axis=0).repeat(enlarged, axis=1)
