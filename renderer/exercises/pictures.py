"""Small pictures of functions: one pixel after the other, and two of them compared."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from renderer.exercises.vectors import Vector

SIZE = 40  # pixels each way; a student's function is called for each
ENLARGED = 6  # pixels of the file for one of the picture, each way
FAILED = (255, 0, 255)  # where the function raises an exception or returns NaN
BACKGROUND = np.array([0.12, 0.14, 0.18])
EYE = np.array([0.0, 0.0, 4.0])


def scan(
    colour: Callable[[float, float], Any], width: int = SIZE, height: int = SIZE
) -> Vector:
    """Return a picture (height, width, 3) of a function of x to the right and y up.

    Both are in (-1, 1), at the centres of pixels. A pixel whose function fails is NaN.
    """
    picture = np.full((height, width, 3), np.nan)
    across, up = ((2.0 * np.arange(n) + 1.0) / n - 1.0 for n in (width, height))
    for row, y in enumerate(up[::-1]):
        for column, x in enumerate(across):
            with np.errstate(all="ignore"):
                try:
                    picture[row, column] = colour(float(x), float(y))
                except Exception:  # the answers to the cases tell what is wrong
                    continue
    return picture


def through(x: float, y: float) -> tuple[Vector, Vector]:
    """Return origin and unit direction of a ray from `EYE` through (x, y)."""
    direction = np.array([0.45 * x, 0.45 * y, -1.0])
    return EYE.copy(), direction / np.sqrt(direction @ direction)


def of_normal(normal: Any) -> Vector:
    """Return a colour for a unit normal."""
    return 0.5 + 0.5 * np.asarray(normal, np.float64)


def png(pictures: Sequence[Vector], titles: Sequence[str] = ()) -> bytes:
    """Return a PNG file of pictures side by side, enlarged, with titles above them."""
    from PIL import Image, ImageDraw  # here, because listing exercises need not wait for it

    top = 16 if titles else 0
    panels = []
    for pixels in pictures:
        broken = np.asarray(~np.isfinite(pixels).all(axis=2))
        levels = 255.0 * np.clip(np.where(broken[..., None], 0.0, pixels), 0.0, 1.0) + 0.5
        panel = levels.astype(np.uint8)
        panel[broken] = FAILED
        panels.append(panel.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1))
    height, width = panels[0].shape[:2]
    whole = Image.new("RGB", (len(panels) * (width + 8) - 8, height + top), "white")
    for k, panel in enumerate(panels):
        whole.paste(Image.fromarray(panel), (k * (width + 8), top))
        if titles:
            ImageDraw.Draw(whole).text((k * (width + 8) + 4, 2), titles[k], fill="black")
    file = io.BytesIO()
    whole.save(file, "PNG")
    return file.getvalue()


def compared(yours: Vector, right: Vector) -> bytes:
    """Return a PNG file of a student's picture, the right one, and their difference."""
    titles = ("yours", "the truth", "difference")
    return png([yours, right, np.abs(yours - right)], titles)
