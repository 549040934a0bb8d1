"""Limits of coordinates, so that single precision can represent squared distances."""

from __future__ import annotations

import math
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import (
    PerspectiveCamera,
    PointLight,
    Projector,
    Sensor,
    SpotLight,
    ThinLensCamera,
)
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element, Value, Vector

FARTHEST = 1e18  # largest coordinate: squared distances do not overflow float32
_PLACING = (
    *("center", "radius", "p0", "p1", "bounds_min", "bounds_max", "to_world"),
    "position",  # of a light
    *("aperture_radius", "focus_distance", "far_clip"),  # the default of the focus
    *("principal_point_offset_x", "principal_point_offset_y"),
)
# if a product of two factors is too large, one of them is at least this
_SUSPECT = 1e9


def check_reach(corners: list[NDArray[np.float32]], properties: Properties) -> None:
    """Refuse a shape whose coordinates are too large to be squared.

    Parameters
    ----------
    corners
        World space points; the box of each primitive is within their boxes.
    properties
        Properties of the shape.

    Raises
    ------
    SceneError
        Names the property with the largest number.
    """
    if not all(np.abs(points).max(initial=0.0) < FARTHEST for points in corners):
        _refuse("makes the shape reach", properties)


def check_place(described: object, properties: Properties) -> None:
    """Refuse a light whose position is too far away to be squared.

    Parameters
    ----------
    described
        The light; for one at infinity the translation is ignored.
    properties
        Properties of the light.

    Raises
    ------
    SceneError
        Names the property with the largest number.
    """
    match described:
        case PointLight():
            place = np.asarray(described.position)
        case SpotLight() | Projector():
            place = described.to_world[:3, 3]
        case _:
            return
    if not np.abs(place).max() < FARTHEST:
        _refuse("puts the light", properties)


def check_camera(camera: Sensor, properties: Properties) -> None:
    """Refuse a camera whose image plane extends too far to be squared.

    Parameters
    ----------
    camera
        The camera; an orthographic one is checked when it is read.
    properties
        Properties of the sensor.

    Raises
    ------
    SceneError
        Names the property with the largest number.
    """
    if not isinstance(camera, PerspectiveCamera):
        return
    film, width = camera.film, 2.0 * math.tan(math.radians(camera.fov_x) / 2.0)
    across = width * (1.0 + abs(camera.principal_point_offset_x))
    along = width * film.height / film.width * (1.0 + abs(camera.principal_point_offset_y))
    reach = 1.0 + across + along  # of the image plane at distance 1
    if isinstance(camera, ThinLensCamera):
        reach = max(reach * camera.focus_distance, camera.aperture_radius)
    if not max(reach, float(np.abs(camera.to_world[:3, 3]).max())) < FARTHEST:
        _refuse("makes the camera's picture reach", properties)


def _refuse(does: str, properties: Properties) -> NoReturn:
    properties.fail(
        _to_blame(properties.element),
        f"what {does} farther than {FARTHEST:g}",
        "coordinates that single precision can square; scale the scene down",
    )


def _to_blame(element: Element) -> str:
    """Return the property with the largest number; for a mesh it may be the file."""
    sizes = {
        name: _size(element.properties[name].value)
        for name in _PLACING
        if name in element.properties
    }
    if "filename" in element.properties:
        sizes["filename"] = _SUSPECT
    return max(sizes, key=sizes.__getitem__)


def _size(value: Value) -> float:
    """Return the largest absolute number of a vector, a matrix or a plain number."""
    numbers = value.xyz if isinstance(value, Vector) else value
    return float(np.abs(np.asarray(numbers, np.float64)).max())
