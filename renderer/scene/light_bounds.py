"""Bounds of the position, direction and power of each light of a scene, by light id."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.kind import BsdfKind
from renderer.plugins.lights.choice.bounds import LightBounds, on_surface
from renderer.plugins.lights.choice.importance import ANY_NORMAL, BOTH_SIDES, IN_FRONT
from renderer.plugins.lights.registry import plugin_of
from renderer.plugins.shapes.registry import kind_of_shape
from renderer.plugins.textures.registry import mean_of
from renderer.scene.light_order import light_order
from renderer.scene.scene import Scene, primitives_of_shapes


def light_bounds(scene: Scene) -> list[LightBounds]:
    """Return the bounds of all lights."""
    order = light_order(scene.description)
    found: dict[int, LightBounds] = {}
    for light, emitter in zip(order.of_emitters, scene.description.emitters, strict=True):
        describe = plugin_of(emitter).bounds
        assert describe is not None
        found[light] = describe(emitter)
    primitives = primitives_of_shapes(scene)
    for shape, light in enumerate(order.of_shapes):
        if light >= 0:
            found[light] = _of_shape(scene, shape, primitives[shape])
    return [found[light] for light in sorted(found)]


def _of_shape(scene: Scene, number: int, primitives: NDArray[np.int32]) -> LightBounds:
    shape = scene.description.shapes[number]
    kind = kind_of_shape(shape)
    surfaces = scene.surfaces[kind.name]
    columns = primitives - surfaces.first
    points, margin, normals = kind.hull(surfaces, columns)
    radiance = shape.radiance
    mean = float(np.mean(radiance)) if isinstance(radiance, tuple) else mean_of(radiance)
    side = float(scene.shapes.orientation[number])
    if not isinstance(radiance, tuple) and kind.textured_side(shape) != side:
        side = 0.0  # it is sampled on one side, and shines on the other
    return on_surface(
        np.asarray(points, np.float64),
        np.asarray(margin, np.float64),
        np.asarray(normals, np.float64) * side,
        kind.areas(surfaces, columns),
        mean,
    )


def lit_sides(kind: BsdfKind) -> int:
    """Return on which side of a surface lights can matter, see `LightChoice.sides`."""
    if _turns_normals(kind):
        return ANY_NORMAL
    return BOTH_SIDES if kind.transmits else IN_FRONT


def _turns_normals(kind: BsdfKind) -> bool:
    return kind.normal is not None or any(map(_turns_normals, kind.inside))
