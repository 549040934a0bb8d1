"""Surface areas of shapes in world space."""

from __future__ import annotations

import math

import numpy as np

from renderer.scene_file.description import Cylinder, Disk, Mesh, Rectangle, Shape, Sphere


def surface_area(shape: Shape) -> float:
    """Return the area of one side of a shape, caps of a cylinder not included.

    Raises
    ------
    TypeError
        For a kind of shape that has no formula here.
    """
    with np.errstate(over="ignore"):
        match shape:
            case Mesh():
                a, b, c = (
                    shape.vertices[shape.faces[:, k]].astype(float) for k in range(3)
                )
                twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
                return 0.5 * float(twice.sum())
            case Rectangle() | Disk():
                x, y = shape.to_world[:3, 0], shape.to_world[:3, 1]
                unit = 4.0 if isinstance(shape, Rectangle) else math.pi
                return unit * float(np.linalg.norm(np.cross(x, y)))
            case Sphere():
                return 4.0 * math.pi * float(np.linalg.norm(shape.to_world[:3, 0])) ** 2
            case Cylinder():
                radius, length = np.linalg.norm(shape.to_world[:3, [0, 2]], axis=0)
                return 2.0 * math.pi * float(radius) * float(length)
            case _:
                raise TypeError(f"no area for {type(shape).__name__}")
