"""Point lights inside of glass, which no path of this renderer can find."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.planning.cautions.caution import Caution, listed, name_of
from renderer.rendering.planning.cautions.closed_meshes import encloses
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Dielectric,
    Mesh,
    PointLight,
    Shape,
    Sphere,
    SpotLight,
    ThinDielectric,
)

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan


def lamps_in_glass(scene: Scene, plan: Plan) -> Iterator[Caution]:
    """Find point and spot lights that glass is closed around."""
    if not plan.asks_lights:
        return
    glass = [
        shape
        for shape in scene.description.shapes
        if isinstance(shape.bsdf, Dielectric | ThinDielectric)
    ]
    lamps, around = 0, []
    for emitter in scene.description.emitters:
        if isinstance(emitter, PointLight):
            place = np.array(emitter.position, np.float64)
        elif isinstance(emitter, SpotLight):
            place = emitter.to_world[:3, 3]
        else:
            continue
        inside = [name_of(shape) for shape in glass if _encloses(shape, place)]
        lamps += bool(inside)
        around += [name for name in inside if name not in around]
    if lamps:
        yield Caution(
            f"point lights that glass is closed around: {lamps} (in {listed(around)}); "
            "what lies beyond gets nothing of them: no path meets a point by chance",
            "point-light-behind-glass",
        )


def _encloses(shape: Shape, point: NDArray[np.float64]) -> bool:
    if isinstance(shape, Sphere):
        local = np.linalg.solve(shape.to_world, np.append(point, 1.0))[:3]
        return bool(np.linalg.norm(local) < 1.0)
    return isinstance(shape, Mesh) and encloses(shape, point)
