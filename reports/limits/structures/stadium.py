"""A teapot in a stadium: a ball of 4000 triangles on a field that grows."""

from __future__ import annotations

import functools
from dataclasses import replace

from reports.accelerator_trials.meshes import teapot_in_a_stadium
from reports.limits.row import Row
from reports.limits.structures.work import UNIT, work_of_a_ray

RINGS = 41  # 4000 triangles
FOV = 20.0  # the ball fills most of the picture
WIDTHS = (2.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5)

_PAD = "Cells hold triangles by boxes grown by the rounding of rays from anywhere in the \
stadium; at 10^5 that is as much as the ball's own cells."
_WASTE = "Boxes fit what they hold, however large the field beside it is."


def _work(width: float, name: str) -> float:
    mesh = teapot_in_a_stadium(RINGS, width)
    view = mesh.view._replace(fov=FOV)
    return work_of_a_ray(name, replace(mesh, view=view))


def _row(name: str, method: str, holds_at: float, fails_at: float | None, why: str) -> Row:
    return Row(
        name=f"stadium-{name}",
        chapter="structures",
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
    )


ROWS = (
    _row(
        "grid",
        "Uniform grid",
        10.0,
        100.0,
        "Cells are of one size: the field decides it, and the teapot fits in one.",
    ),
    _row("grid-nested", "Grid in grid", 3e3, 1e5, _PAD),
    _row("grid-clusters", "Grids around clusters", 3e3, 1e5, _PAD),
    _row("octree", "Octree", 1e4, 1e5, _PAD),
    _row("bsp", "BSP tree", 1e3, 1e5, _PAD),
    _row("kd-middle", "k-d tree cut in the middle", 1e4, 1e5, _PAD),
    _row("kd-median", "k-d tree cut at the median", 1e3, 1e5, _PAD),
    _row("kd-sah", "k-d tree by surface area", 1e4, 1e5, _PAD),
    _row("bvh", "BVH by surface area", 1e5, None, _WASTE),
    _row("wide", "BVH of eight children", 1e5, None, _WASTE),
)
