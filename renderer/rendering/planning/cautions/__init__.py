"""Cautions: what a scene asks of a method that the method is known to fail at.

Each is drawn from the description alone. What stands in front of what, and what mirrors
show, is not looked at: a caution holds where the camera sees what it names. Silence is no
promise: what a check gives up is named in its docstring, and none but that of far
coordinates looks into instances. Each stands under the row of the atlas of failures
(`reports/limits`) that measures it. Nothing here is asked for while a picture is rendered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from renderer.rendering.planning.cautions.caution import Caution
from renderer.rendering.planning.cautions.coincident_surfaces import coincident_surfaces
from renderer.rendering.planning.cautions.depth_in_glass import depth_in_glass
from renderer.rendering.planning.cautions.far_coordinates import far_coordinates
from renderer.rendering.planning.cautions.lamps_in_glass import lamps_in_glass
from renderer.rendering.planning.cautions.starved_lamps import starved_lamps
from renderer.scene.scene import Scene

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan

__all__ = ["CHECKS", "Caution", "cautions_of"]

# row of the atlas -> what finds scenes that are in it
CHECKS: Mapping[str, Callable[[Scene, Plan], Iterator[str]]] = {
    "far-from-origin": far_coordinates,
    "coincident-surfaces": coincident_surfaces,
    "point-light-behind-glass": lamps_in_glass,
    "lamps-starved": starved_lamps,
    "glass-depth": depth_in_glass,
}


def cautions_of(scene: Scene, plan: Plan) -> tuple[Caution, ...]:
    """Return all that is to be said about a scene that is rendered so."""
    return tuple(
        Caution(text, row) for row, check in CHECKS.items() for text in check(scene, plan)
    )
