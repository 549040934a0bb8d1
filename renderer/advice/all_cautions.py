"""Cautions: properties of a scene for which the chosen method is known to fail.

Each follows from the description alone. Visibility and reflections are not considered: a
caution applies if the camera sees what it names. No caution is no guarantee: the docstring
of a check tells what it ignores, and only the check of far coordinates includes instances.
Each check has the name of its measurement in the atlas of failures (`reports/atlas`). No
check runs during a render.
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

# name in the atlas -> function that yields the cautions of a scene
CHECKS: Mapping[str, Callable[[Scene, Plan], Iterator[str]]] = {
    "far-from-origin": far_coordinates,
    "coincident-surfaces": coincident_surfaces,
    "point-light-behind-glass": lamps_in_glass,
    "lamps-starved": undersampled_lights,
    "glass-depth": depth_in_glass,
}


def cautions_of(scene: Scene, plan: Plan) -> tuple[Caution, ...]:
    """Return all cautions of a scene and a plan.

    An exception in a check does not end a render: it is reported in place of its cautions,
    and as a warning, which makes tests fail.
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
