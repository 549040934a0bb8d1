"""Point lights inside of glass, which no path of this renderer can find."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from renderer.kinds.textures.registry import mean_of
from renderer.rendering.planning.cautions.caution import listed, name_of
from renderer.rendering.planning.cautions.closed_shapes import encloses, is_closed
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Dielectric,
    Mask,
    Null,
    PointLight,
    SpotLight,
    ThinDielectric,
)

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan


def lamps_in_glass(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find point and spot lights that smooth glass, nothing or holes are closed around.

    Rough glass is found by shadow rays and does not count. Spheres and meshes are looked
    at, not what several shapes enclose together.
    """
    if not plan.asks_lights:
        return
    shapes = scene.description.shapes
    glass = [shape for shape in shapes if _stops(shape.bsdf) and is_closed(shape)]
    lamps, around = 0, []
    for emitter in scene.description.emitters if glass else ():
        if isinstance(emitter, PointLight):
            place = np.array(emitter.position, np.float64)
        elif isinstance(emitter, SpotLight):
            place = emitter.to_world[:3, 3]
        else:
            continue
        inside = [name_of(shape) for shape in glass if encloses(shape, place)]
        lamps += bool(inside)
        around += [name for name in inside if name not in around]
    if lamps:
        yield (
            f"point lights that glass, `null` or `mask` is closed around: {lamps} (in "
            f"{listed(around)}); what lies beyond gets nothing of them directly: shadow "
            "rays end there, and no path meets a point by chance"
        )


def _stops(bsdf: Any) -> bool:
    """Return whether light goes through where a shadow ray does not."""
    if isinstance(bsdf, Mask):
        return mean_of(bsdf.opacity) < 1.0 or _stops(bsdf.nested)
    return isinstance(bsdf, Dielectric | ThinDielectric | Null)
