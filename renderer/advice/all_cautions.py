"""Cautions: what in a scene the chosen method is known to fail at.

Each is drawn from the description alone. What stands in front of what, and what mirrors
show, is not looked at: a caution holds where the camera sees what it names. Silence is no
promise: what a check gives up is named in its docstring, and none but that of far
coordinates looks into instances. Each has the name of what measures it in the atlas of
failures (`reports/atlas`). Nothing here runs while a picture is rendered.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping

from renderer.advice.cautions import (
    Caution,
    depth_in_glass,
    far_coordinates,
    lamps_in_glass,
    undersampled_lights,
)
from renderer.advice.coincident_surfaces import coincident_surfaces
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene

__all__ = ["CHECKS", "Caution", "cautions_of"]

# name in the atlas -> what finds scenes that are in it
CHECKS: Mapping[str, Callable[[Scene, Plan], Iterator[str]]] = {
    "far-from-origin": far_coordinates,
    "coincident-surfaces": coincident_surfaces,
    "point-light-behind-glass": lamps_in_glass,
    "lamps-starved": undersampled_lights,
    "glass-depth": depth_in_glass,
}


def cautions_of(scene: Scene, plan: Plan) -> tuple[Caution, ...]:
    """Return all that is to be said about a scene that is rendered so.

    A defect of a check breaks no render: it is said in the place of its cautions, and
    warned of, which fails tests.
    """
    found: list[Caution] = []
    for row, check in CHECKS.items():
        try:
            found += [Caution(text, row) for text in check(scene, plan)]
        except Exception as error:
            defect = f"not checked: {type(error).__name__}: {error}; a defect of lightproof"
            found.append(Caution(defect, row))
            warnings.warn(f"caution {row!r} {defect}", RuntimeWarning, stacklevel=2)
    return tuple(found)
