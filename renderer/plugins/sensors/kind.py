"""The interface of a kind of sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from renderer.kernels.jit import interface


class CameraRay(NamedTuple):
    """Camera rays, clipped to the near and far planes; scalar or 16 lanes."""

    origin: Any  # on the near plane
    direction: Any  # unit
    length: Any  # distance to the far plane


@dataclass(frozen=True)
class SensorKind:
    """One kind of sensor; its kernel implements `camera_ray`.

    Parameters
    ----------
    name
        Name of the plugin in scene files.
    description
        Class of the description that `read` returns; each kind has its own.
    read
        Function of the properties of a file that returns the description.
    record
        description -> the record of the kernel.
    has_aperture
        Whether rays start on a lens: each needs two additional random numbers.
    """

    name: str
    description: type
    read: Callable[[Any], Any]
    record: Callable[[Any], Any]
    has_aperture: bool = False


@interface
def camera_ray(sensor: Any, px: Any, py: Any, lens_x: Any, lens_y: Any) -> CameraRay:
    """Return the camera rays for positions on the film.

    Parameters
    ----------
    px, py
        Position on the full film, in pixels from its upper left corner.
    lens_x, lens_y
        Numbers in [0, 1) that give the position on the lens, if there is one.
    """
