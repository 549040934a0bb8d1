"""Registers all kinds of shape. Primitive ids are assigned in this order."""

from __future__ import annotations

from renderer.plugins.shapes.bsplinecurve import BSPLINE_PIECES
from renderer.plugins.shapes.cylinder import CYLINDERS
from renderer.plugins.shapes.disk import DISKS
from renderer.plugins.shapes.implicit import IMPLICITS
from renderer.plugins.shapes.kind import ShapeKind, ShapePlugin
from renderer.plugins.shapes.linearcurve import LINEAR_SEGMENTS
from renderer.plugins.shapes.rectangle import RECTANGLES
from renderer.plugins.shapes.sdfgrid import SDF_CELLS
from renderer.plugins.shapes.sphere import SPHERES
from renderer.plugins.shapes.triangle import TRIANGLES

SHAPES: dict[str, ShapeKind] = {}
KINDS: list[str] = []  # names of the kinds, in the order of primitive ids
PLUGINS: dict[str, ShapePlugin] = {}


def register_shape(kind: ShapeKind) -> None:
    """Register a kind of shape with the scene reader and the kernels."""
    kind.register_kernels()
    if kind.name not in SHAPES:
        KINDS.append(kind.name)
    SHAPES[kind.name] = kind
    for name, make in kind.plugins.items():
        PLUGINS[name] = ShapePlugin(kind, make)


for _kind in (
    TRIANGLES,
    RECTANGLES,
    DISKS,
    SPHERES,
    CYLINDERS,
    IMPLICITS,
    SDF_CELLS,
    LINEAR_SEGMENTS,
    BSPLINE_PIECES,
):
    register_shape(_kind)


def kind_of_shape(shape: object) -> ShapeKind:
    """Return the kind of a shape of the scene description."""
    return next(kind for kind in SHAPES.values() if isinstance(shape, kind.description))
