"""A limit of depth that ends paths inside of glass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from renderer.rendering.planning.cautions.caution import Caution, listed, name_of
from renderer.scene.scene import Scene
from renderer.scene_file.description import Dielectric, ThinDielectric

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan

# Segments from the camera to what is lit behind glass, and to its lamp: into the glass,
# out of it (a thin pane is passed at once), to the surface, to the lamp.
THROUGH = {Dielectric: 4, ThinDielectric: 3}


def depth_in_glass(scene: Scene, plan: Plan) -> Iterator[Caution]:
    """Find glass through which nothing that is lit can be seen at all."""
    if not plan.kind.sees_lights or plan.kind.first_hit:
        return
    dark = [
        shape
        for shape in scene.description.every_shape
        if plan.max_depth < THROUGH.get(type(shape.bsdf), 0)
    ]
    if dark:
        needed = max(THROUGH[type(shape.bsdf)] for shape in dark)
        yield Caution(
            f"shapes of glass in which paths of {plan.max_depth} segments end: {len(dark)} "
            f"({listed([name_of(shape) for shape in dark])}); they show no lit surface "
            f"behind them, which takes {needed} segments",
            "glass-depth",
        )
