"""How far from the origin a shape may reach: as far as single precision can square."""

from __future__ import annotations

import numpy as np

from renderer.scene_file.description import Cylinder, Disk, Mesh, Rectangle, Shape, Sphere
from renderer.scene_file.document.tree import Element, Value, Vector
from renderer.scene_file.properties import Properties

FARTHEST = 1e18  # largest coordinate: squares of distances still fit float32
_PLACING = ("center", "radius", "p0", "p1", "to_world")
# two factors whose product is too far: one of them is at least this large
_SUSPECT = 1e9


def check_reach(shape: Shape, properties: Properties) -> None:
    """Refuse a shape whose coordinates are too large to be squared.

    Raises
    ------
    SceneError
        Naming the property that takes it so far.
    """
    if not largest_coordinate(shape) < FARTHEST:
        properties.fail(
            _to_blame(properties.element),
            f"what makes the shape reach farther than {FARTHEST:g}",
            "coordinates that single precision can square; scale the scene down",
        )


def largest_coordinate(shape: Shape) -> float:
    """Return the largest absolute coordinate of a shape in world space.

    Raises
    ------
    TypeError
        For a kind of shape that is unknown here.
    """
    if isinstance(shape, Mesh):
        reach = np.abs(shape.vertices).max()
        if not reach < FARTHEST:  # a vertex that no face uses does not count
            reach = np.abs(shape.vertices[shape.faces]).max()
        return float(reach)
    if not isinstance(shape, Rectangle | Disk | Sphere | Cylinder):
        raise TypeError(f"no reach for {type(shape).__name__}")
    x, y, _, center = np.abs(shape.to_world[:3]).T
    match shape:
        case Rectangle():
            reach = center + x + y
        case Disk():
            reach = center + np.hypot(x, y)
        case Sphere():
            reach = center + np.linalg.norm(x)
        case Cylinder():
            top = np.abs(shape.to_world[:3, 3] + shape.to_world[:3, 2])
            reach = np.maximum(center, top) + np.hypot(x, y)
    return float(reach.max())


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
