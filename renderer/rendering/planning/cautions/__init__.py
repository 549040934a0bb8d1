"""Cautions: what a scene asks of a method that the method is known to fail at.

Each is said only where it is certain, and names the row of the atlas of failures
(`reports/limits`) that measures it. Nothing here is asked for while a picture is rendered.
"""

from __future__ import annotations

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

__all__ = ["Caution", "cautions_of"]

_CHECKS = (
    far_coordinates,
    coincident_surfaces,
    lamps_in_glass,
    starved_lamps,
    depth_in_glass,
)


def cautions_of(scene: Scene, plan: Plan) -> tuple[Caution, ...]:
    """Return all that is to be said about a scene that is rendered so."""
    return tuple(caution for check in _CHECKS for caution in check(scene, plan))
