"""What glass hides: lights inside of it, and all behind it where paths are too short."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from renderer.plugins.textures.registry import mean_of
from renderer.rendering.planning.cautions.caution import listed, name_of
from renderer.rendering.planning.cautions.closed_shapes import encloses, is_closed
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Dielectric,
    Mask,
    Null,
    PointLight,
    SpotLight,
    ThinDielectric,
)

THROUGH_A_SURFACE = 3  # segments: to the glass, to what is lit behind it, to its lamp
THROUGH_A_BODY = 4  # one more, out of the glass


def depth_in_glass(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find glass through which nothing that is lit can be seen at all.

    Each shape by itself: glass in glass or behind glass takes more segments than this
    knows of, and so does glass in instances, which counts as one surface.
    """
    if not plan.kind.sees_lights or plan.kind.first_hit:
        return
    needed = {
        shape: THROUGH_A_SURFACE
        for shape in scene.description.every_shape
        if isinstance(shape.bsdf, Dielectric | ThinDielectric)
    }
    eye = scene.description.camera.to_world[:3, 3]
    if plan.max_depth < THROUGH_A_BODY:
        for shape in scene.description.shapes:
            glass = isinstance(shape.bsdf, Dielectric) and is_closed(shape)
            if glass and not encloses(shape, eye):
                needed[shape] = THROUGH_A_BODY
    dark = [shape for shape in needed if plan.max_depth < needed[shape]]
    if dark:
        yield (
            f"shapes of glass in which paths of {plan.max_depth} segments end: {len(dark)} "
            f"({listed([name_of(shape) for shape in dark])}); they show no lit surface "
            f"behind them, which takes {max(needed[shape] for shape in dark)} segments"
        )


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
