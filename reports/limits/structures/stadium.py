"""A teapot in a stadium: a ball of 4000 triangles on a field that grows."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records.batch import NODES, PRIMITIVES
from reports.accelerator_trials.meshes import StudyMesh, teapot_in_a_stadium
from reports.accelerator_trials.rays import pixel_order
from reports.limits.row import Row
from reports.limits.structures.work import UNIT, counted, seen_from, work_of_a_ray
from reports.look.heat_map import RAMP

RINGS = 41  # 4000 triangles
FOV = 20.0  # the ball fills most of the picture
WIDTHS = (2.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5)

_PAD = "Cells hold triangles by boxes grown by the rounding of rays from anywhere in the \
stadium; at 10^5 that is as much as the ball's own cells."
_WASTE = "Boxes fit what they hold, however large the field beside it is."


SIDE = 128  # pixels of a picture


OFF_CENTRE = 0.03  # of the width: in the middle four cells of the grid share the ball


def at_width(width: float) -> StudyMesh:
    """Return the ball, seen so that it fills the picture, on a field so wide."""
    mesh = teapot_in_a_stadium(RINGS, width)
    vertices = mesh.vertices.copy()
    vertices[-4:, :2] += np.float32(OFF_CENTRE * width)  # the field, below the same ball
    return replace(mesh, vertices=vertices, view=mesh.view._replace(fov=FOV))


def _work(width: float, name: str) -> float:
    return work_of_a_ray(name, at_width(width))


def picture() -> NDArray[np.uint8]:
    """Return the work of each pixel: grid at 2, 10, 100; BVH at 100. Brighter is more."""
    shown = []
    order = pixel_order(SIDE, SIDE)
    for name, width in (("grid", 2.0), ("grid", 10.0), ("grid", 100.0), ("bvh", 100.0)):
        mesh = at_width(width)
        tally = counted(name, mesh, seen_from(mesh, SIDE))
        work = np.empty(SIDE * SIDE)
        work[order] = tally[NODES] + tally[PRIMITIVES]
        shown.append(work.reshape(SIDE, SIDE))
    brightness = np.log(np.maximum(np.concatenate(shown, axis=1), 1.0)) / np.log(4000.0)
    at = np.linspace(0.0, 1.0, len(RAMP))
    channels = [np.interp(brightness, at, RAMP[:, k]) for k in range(3)]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


def _row(name: str, method: str, holds_at: float, fails_at: float | None, why: str) -> Row:
    return Row(
        name=f"stadium-{name}",
        method=method,
        stress="width of the stadium over that of the teapot",
        measure=functools.partial(_work, name=name),
        quantity="cost",
        unit=UNIT,
        strengths=WIDTHS,
        tolerance=300.0,
        holds_at=holds_at,
        fails_at=fails_at,
        why=why,
        instead="Nothing." if fails_at is None else "A BVH: the last rows of the stadium.",
        source="Haines, Ray Tracing News 1(9), 1988; measured here",
        picture=picture if name == "grid" else None,
        caption="Nodes, cells and triangles of each pixel, logarithmic, 1 to 4000: grids "
        "in stadiums 2, 10 and 100 wide, and last the BVH in that of 100.",
    )


ROWS = (
    _row(
        "grid",
        "Uniform grid",
        10.0,
        100.0,
        "Cells are of one size, and the field decides it: in a wide one the whole teapot "
        "is in one cell, and each ray tests all of it.",
    ),
    _row("grid-nested", "Grid in grid", 3e3, 1e5, _PAD),
    _row("grid-clusters", "Grids around clusters", 3e3, 1e5, _PAD),
    _row("octree", "Octree", 1e4, 1e5, _PAD),
    _row("bsp", "BSP tree", 1e3, 1e5, _PAD),
    _row("kd-middle", "k-d tree cut in the middle", 1e4, 1e5, _PAD),
    _row("kd-median", "k-d tree cut at the median", 300.0, 1e5, _PAD),
    _row("kd-sah", "k-d tree by surface area", 1e4, 1e5, _PAD),
    _row("bvh", "BVH by surface area", 1e5, None, _WASTE),
    _row("wide", "BVH of eight children", 1e5, None, _WASTE),
)
