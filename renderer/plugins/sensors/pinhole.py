"""The pinhole camera by the lecture's parameters: position o, focal vector f, up vector.

f leads from o to the centre of the image plane. x and y are one pixel to the right and one
pixel down; the ray of pixel position (u, v) has the direction
f + (u - xres/2) x + (v - yres/2) y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import PerspectiveCamera


@dataclass(frozen=True, eq=False)
class Pinhole:
    """The lecture's camera; vectors are (3,) in world space."""

    o: NDArray[np.float64]  # position of the eye
    f: NDArray[np.float64]  # to the centre of the image plane, at unit distance
    up: NDArray[np.float64]  # unit, perpendicular to f
    x: NDArray[np.float64]  # one pixel to the right
    y: NDArray[np.float64]  # one pixel down
    xres: int
    yres: int

    def corner(self, border: int) -> NDArray[np.float64]:
        """Return the vector to the corner, `border` pixels beyond that of the film."""
        x, y = self.xres / 2.0 + border, self.yres / 2.0 + border
        return self.f - self.x * x - self.y * y


def pinhole(camera: PerspectiveCamera) -> Pinhole:
    """Return the lecture's parameters of a perspective camera of a scene file.

    The file's camera looks along local +z with +y up and +x to the *left*; its principal
    point offsets move the image by a fraction of the film's width and height.
    """
    film = camera.film
    left, up, forward = (
        camera.to_world[:3, k] / np.linalg.norm(camera.to_world[:3, k]) for k in range(3)
    )
    width = 2.0 * np.tan(np.radians(camera.fov_x) / 2.0)  # of the image plane
    x = -left * (width / film.width)
    y = -up * (width / film.width)  # pixels are square
    middle = (
        forward
        + x * (camera.principal_point_offset_x * film.width)
        + y * (camera.principal_point_offset_y * film.height)
    )
    return Pinhole(camera.to_world[:3, 3], middle, up, x, y, film.width, film.height)


def vector_column(vector: Any) -> NDArray[np.float32]:
    """Return a vector as kernels load it, (3, 1)."""
    return np.ascontiguousarray(np.reshape(vector, (3, 1)), np.float32)
