"""All kinds of shape: one line makes a kind known. Primitive ids go in this order."""

from __future__ import annotations

import renderer.lights.spheres  # noqa: F401  (how spheres are sampled as lamps)
from renderer.shapes.cylinder import CYLINDERS
from renderer.shapes.disk import DISKS
from renderer.shapes.kind import ShapeKind
from renderer.shapes.rectangle import RECTANGLES
from renderer.shapes.sphere import SPHERES
from renderer.shapes.triangle import TRIANGLES

SHAPES: dict[str, ShapeKind] = {
    kind.name: kind for kind in (TRIANGLES, RECTANGLES, DISKS, SPHERES, CYLINDERS)
}


def kind_of_shape(shape: object) -> ShapeKind:
    """Return the kind of a shape of the description."""
    return next(kind for kind in SHAPES.values() if isinstance(shape, kind.description))
