"""The structure of each kind of primitive: as asked for, or the cheapest to expect."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.cost_model import (
    SAMPLE,
    USUAL_RAYS,
    RayCounts,
    box_dimension,
    estimate_all,
)
from renderer.accelerators.rays.boxes import expected_cost
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.plugins.shapes.registry import SHAPES
from renderer.scene.scene import Scene

_TO_BUILD_BOXES = 2e-3  # seconds that they must save, five times what they take
_MOST_IN_BOXES = 1024  # above it they take longer to build, and a tree pays


class Choice(NamedTuple):
    """A structure's name and why it was taken."""

    name: str
    reason: str


def choose_structures(
    scene: Scene, asked: str, rays: RayCounts = USUAL_RAYS
) -> dict[str, Choice]:
    """Return what to build for each kind of primitive outside of groups.

    Parameters
    ----------
    scene
        The primitives.
    asked
        The name of a structure, or "auto".
    rays
        That will be traced.
    """
    found: dict[str, Choice] = scene.recently(
        "structures", (asked, rays), _choose_structures, scene, asked, rays
    )
    return found


def _choose_structures(scene: Scene, asked: str, rays: RayCounts) -> dict[str, Choice]:
    chosen = {}
    for kind, surfaces in scene.surfaces.items():
        count = int(scene.starts[kind][0])
        if count:
            chosen[kind] = choose_structure(
                kind, surfaces, count, asked, rays, scene.bounds
            )
    return chosen


def choose_structure(
    kind: str,
    surfaces: Any,
    count: int,
    asked: str,
    rays: RayCounts = USUAL_RAYS,
    room: NDArray[np.float64] | None = None,
) -> Choice:
    """Return what to build for the first `count` primitives of one kind.

    `room` are the corners, (2, 3), of the box that rays fill; None: that of the primitives.
    """
    if not SHAPES[kind].wide and asked in ("auto", "wide"):
        return Choice("bvh", "the tree for primitives that are tested one at a time")
    if asked != "auto":
        return Choice(asked, "as asked for")
    sample = primitive_bounds(kind, _sample(surfaces, count))
    dimension = box_dimension(*sample)
    best, second = estimate_all(count, dimension, rays)[:2]
    spread = "on surfaces" if dimension < 2.5 else "through space"
    number = rays.coherent + rays.incoherent
    if best.name == "brute" and count <= _MOST_IN_BOXES:
        tests = expected_cost(*sample, room)
        if (count - tests) / count * best.trace > _TO_BUILD_BOXES:
            reason = (
                f"about {number:.1g} rays are expected, and boxes to cost each of them "
                f"as much as {tests:.2g} tests of a primitive, not {count}"
            )
            return Choice("boxes", reason)
    reason = (
        f"about {number:.1g} rays are expected, through primitives {spread}; estimated are "
        f"{_seconds(best.build)} to build and {_seconds(best.trace)} to trace, "
        f"for {second.name} {_seconds(second.build)} and {_seconds(second.trace)}"
    )
    return Choice(best.name, reason)


def _sample(surfaces: Any, count: int) -> Any:
    """Return at most about `SAMPLE` primitives of a record."""
    stride = -(-count // SAMPLE)
    fields = (
        field[..., :count:stride] if isinstance(field, np.ndarray) else field
        for field in surfaces
    )
    return type(surfaces)(*fields)


def _seconds(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 0.1 else f"{1e3 * seconds:.2g} ms"
