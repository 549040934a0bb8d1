"""How far from the origin shapes and lights may be: single precision must square it."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import PointLight, Projector, SpotLight
from renderer.scene_file.document.tree import Element, Value, Vector
from renderer.scene_file.properties import Properties

FARTHEST = 1e18  # largest coordinate: squares of distances still fit float32
_PLACING = (
    *("center", "radius", "p0", "p1", "bounds_min", "bounds_max", "to_world"),
    "position",  # of a light
)
# two factors whose product is too far: one of them is at least this large
_SUSPECT = 1e9


def check_reach(corners: list[NDArray[np.float32]], properties: Properties) -> None:
    """Refuse a shape whose coordinates are too large to be squared.

    Parameters
    ----------
    corners
        Coordinates in the world, of points whose boxes hold the primitives of a shape.
    properties
        Of the shape.

    Raises
    ------
    SceneError
        Naming the property that takes it so far.
    """
    if not all(np.abs(points).max() < FARTHEST for points in corners):
        _refuse("makes the shape reach", properties)


def check_place(described: object, properties: Properties) -> None:
    """Refuse a light that stands too far away for its distance to be squared.

    Parameters
    ----------
    described
        The light; of those at infinity a translation means nothing.
    properties
        Of the light.

    Raises
    ------
    SceneError
        Naming the property that puts it there.
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


def _refuse(does: str, properties: Properties) -> NoReturn:
    properties.fail(
        _to_blame(properties.element),
        f"what {does} farther than {FARTHEST:g}",
        "coordinates that single precision can square; scale the scene down",
    )


def _to_blame(element: Element) -> str:
    """Return the property with the largest number; of a mesh it may be the file."""
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
