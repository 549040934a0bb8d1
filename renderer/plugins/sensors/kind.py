"""The interface of a kind of sensor: its records and how it makes rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from renderer.kernels.jit import interface


class CameraRay(NamedTuple):
    """The part of a ray, or of 16 in lanes, that lies between the near and far planes."""

    origin: Any  # on the near plane
    direction: Any  # unit
    length: Any  # up to the far plane


@dataclass(frozen=True)
class SensorKind:
    """One kind of sensor; its kernel is an implementation of `camera_ray`.

    Parameters
    ----------
    name
        Of the plugin in scene files.
    description
        The class that `read` returns, and no other kind.
    read
        Makes the description from the properties of a file.
    record
        description -> the record of its kernel.
    has_aperture
        Whether rays begin all over a lens: two more numbers are drawn for each.
    """

    name: str
    description: type
    read: Callable[[Any], Any]
    record: Callable[[Any], Any]
    has_aperture: bool = False


@interface
def camera_ray(sensor: Any, px: Any, py: Any, lens_x: Any, lens_y: Any) -> CameraRay:
    """Return the ray through a place on the film.

    Parameters
    ----------
    px, py
        On the full film, in pixels from its upper left corner.
    lens_x, lens_y
        Numbers in [0, 1) that choose a place on the lens, if there is one.
    """
