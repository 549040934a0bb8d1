"""A limit of depth that ends paths inside of glass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from renderer.rendering.planning.cautions.caution import listed, name_of
from renderer.rendering.planning.cautions.closed_shapes import encloses, is_closed
from renderer.scene.scene import Scene
from renderer.scene_file.description import Dielectric, ThinDielectric

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan

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
