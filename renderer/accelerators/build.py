"""From a scene to one accelerator for each kind of primitive that it has."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.brute_force import build_brute_force
from renderer.accelerators.bvh import Bvh
from renderer.accelerators.bvh_build import build_bvh
from renderer.errors import SceneError
from renderer.kernel_scene import EMIT, Accelerators
from renderer.scene import KINDS, Scene, emits, primitive_bounds
from renderer.shapes.cylinder import Cylinders
from renderer.shapes.disk import Disks
from renderer.shapes.rectangle import Rectangles
from renderer.shapes.sphere import Spheres
from renderer.shapes.triangle import Triangles

NAMES = ("auto", "brute", "bvh")
# Up to so many primitives, testing all of them for 16 rays at once costs less than any
# tree's boxes (docs/performance.md, "Brute force or tree").
FEW = 64

_FLAT = {"triangles": Triangles, "rectangles": Rectangles, "disks": Disks}


def _padded(rows: NDArray[Any]) -> NDArray[Any]:
    """Append 16 columns of zeros, so that 16 primitives can be loaded from any column."""
    widths = [(0, 0)] * (rows.ndim - 1) + [(0, 16)]
    return np.ascontiguousarray(np.pad(rows, widths))


def primitive_group(kind: str, surfaces: Any, order: NDArray[np.int64]) -> Any:
    """Return the group of a kind's primitives in the given order (column numbers)."""
    ids = _padded((order + surfaces.first).astype(np.int32))
    count = len(order)
    if kind == "spheres":
        center, radius = surfaces.center[:, order], surfaces.radius[order]
        return Spheres(_padded(center), _padded(radius), ids, count)
    if kind == "cylinders":
        return Cylinders(
            _padded(surfaces.base[:, order]),
            _padded(surfaces.frame[6:9, order]),
            _padded(surfaces.radius[order]),
            _padded(surfaces.height[order]),
            ids,
            count,
        )
    edge1, edge2 = surfaces.edge1[:, order], surfaces.edge2[:, order]
    normal = np.cross(edge1.T.astype(np.float64), edge2.T.astype(np.float64)).T
    return _FLAT[kind](
        _padded(surfaces.corner[:, order]),
        _padded(edge1),
        _padded(edge2),
        _padded(normal.astype(np.float32)),
        ids,
        count,
    )


def build_accelerator(kind: str, surfaces: Any, order: NDArray[np.int64], name: str) -> Any:
    """Build the accelerator `name` over the given columns of one kind of primitive."""
    if name == "brute" or (name == "auto" and len(order) <= FEW):
        return build_brute_force(primitive_group(kind, surfaces, order))
    lower, upper = primitive_bounds(kind, surfaces)
    tree = build_bvh(
        np.ascontiguousarray(lower[:, order]), np.ascontiguousarray(upper[:, order])
    )
    group = primitive_group(kind, surfaces, order[tree.order])
    return Bvh(tree.bounds, tree.child, tree.count, group)


def compile_builders(scene: Scene, name: str) -> float:
    """Compile what `build_accelerators` will need; return the seconds it took."""
    started = time.perf_counter()
    few = all(s.end - s.first <= FEW for s in scene.surfaces.values())
    if name == "bvh" or (name == "auto" and not few):
        box = np.zeros((3, 1), np.float32)
        build_bvh(box, box)
    return time.perf_counter() - started


def build_accelerators(
    scene: Scene, name: str, *, without_emitters_of: Accelerators | None = None
) -> Accelerators:
    """Build for all kinds; None for kinds that the scene lacks.

    Parameters
    ----------
    scene : Scene
        The primitives.
    name : str
        One of `NAMES`; `auto` takes brute force for a few primitives, else the BVH.
    without_emitters_of : Accelerators, optional
        The accelerators of all primitives; given, area lights are left out: what a camera
        sees that hides them. Kinds that have none are taken over as they are.

    Raises
    ------
    SceneError
        If there is no accelerator of that name.
    """
    if name not in NAMES:
        raise SceneError(f"accelerator {name!r} is unknown; there are: {', '.join(NAMES)}")
    built: dict[str, Any] = dict.fromkeys(KINDS)
    for kind, surfaces in scene.surfaces.items():
        order = np.arange(surfaces.end - surfaces.first)
        if without_emitters_of is not None:
            if not emits(scene, kind):
                built[kind] = getattr(without_emitters_of, kind)
                continue
            order = order[(scene.stages[surfaces.first : surfaces.end] & EMIT) == 0]
        if len(order):
            built[kind] = build_accelerator(kind, surfaces, order, name)
    return Accelerators(**built)
