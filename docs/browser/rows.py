"""Rows of a picture, one at a time: what a worker of the page calls.

In a browser `stand_ins` is imported first.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Sequence
from typing import Any

import numpy as np

from renderer.scene_file import read_string
from renderer.simple.path_tracer import estimates
from renderer.simple.scene import Scene

state: dict[str, Any] = {}


def numbers(pixel: int, sample: int, block: int) -> Sequence[float]:
    """Return four random numbers; Python's generator starts faster than NumPy's.

    In a browser the picture takes 0.7 times as long as with `numpy_numbers`.
    """
    draw = random.Random(pixel << 64 | sample << 40 | block).random
    return draw(), draw(), draw(), draw()


def begin(xml: str, size: int, integrator: str) -> None:
    """Read a scene, to be rendered with size x size pixels.

    Raises
    ------
    SceneError
        For what the readable renderer cannot render; one line.
    """
    description = read_string(xml, width=size, height=size)
    state["camera"] = description.camera
    state["scene"] = Scene(description, integrator)


def row(y: int) -> bytes:
    """Return one sample of each pixel of a row: float32 red, green, blue, linear sRGB."""
    camera = state["camera"]
    film = dataclasses.replace(camera.film, crop_offset_y=y, crop_height=1)
    one = dataclasses.replace(camera, film=film)
    colours = [light for _, _, light in estimates(state["scene"], one, 1, numbers)]
    return np.array(colours, np.float32).tobytes()
