"""Methods of shapes: rays through accelerators, and surface points of what they hit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types
from numpy.typing import NDArray

from renderer.accelerators.build import Accelerators
from renderer.accelerators.bvh.wide_bvh import WideBvh
from renderer.accelerators.dispatch import TRAVERSALS
from renderer.integrators.stages.surface import derive, locate
from renderer.kernels.jit import record_type
from renderer.kernels.records.kernel_scene import Placements, Settings, Shapes
from renderer.plugins.shapes.registry import SHAPES, kind_of_shape
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.methods import (
    COLUMN,
    INT,
    NOTHING,
    MethodSpec,
    MethodTables,
    work_types,
)
from renderer.scene.scene import Scene


def group_methods(
    tables: MethodTables, accelerators: Accelerators, plan: Plan
) -> NDArray[np.int64]:
    """Return the methods that find nearest hits with the accelerators."""
    work = work_types()
    tally = types.Array(types.int32, 2, "C") if plan.kind.counts_work else NOTHING
    closest = (work.rays, work.hits, INT, INT, tally)
    rows = []
    for accelerator in _built(accelerators):
        t = TRAVERSALS[type(accelerator)]
        methods: list[MethodSpec | None] = [(t.closest_hit_coherent, closest, NOTHING)]
        deep = plan.max_depth > 1 or plan.kind.media
        methods.append((t.closest_hit, closest, NOTHING) if deep else None)
        rows.append((tables.pack(accelerator), methods))
    return tables.table(rows, 2)


def shadow_methods(
    tables: MethodTables, accelerators: Accelerators, lamps: bool
) -> NDArray[np.int64]:
    """Return the methods that test shadow rays.

    `lamps`: some shadow rays end on area lights. Rays of neighbouring points then diverge,
    and ray streams are faster than packets.
    """
    blocked = (work_types().shadow_rays, INT, NOTHING)
    rows = []
    for accelerator in _built(accelerators):
        t = TRAVERSALS[type(accelerator)]
        parting = lamps and isinstance(accelerator, WideBvh)
        together = t.any_hit if parting else t.any_hit_coherent
        methods = [(together, blocked, NOTHING), (t.any_hit, blocked, NOTHING)]
        rows.append((tables.pack(accelerator), methods))
    return tables.table(rows, 2)


def _built(accelerators: Accelerators) -> list[Any]:
    instances = [] if accelerators.instances is None else [accelerators.instances]
    return [*accelerators.by_kind.values(), *instances]


def surface_methods(
    tables: MethodTables,
    surfaces: dict[str, Any],
    settings: Settings,
    shapes: Shapes,
    placements: Placements,
) -> NDArray[np.int64]:
    """Return the methods that compute surface points from hits."""
    work = work_types()
    arguments = (
        *(record_type(record) for record in (settings, shapes, placements)),
        work.hits,
        COLUMN,
        INT,
        work.points,
    )
    rows = [
        (tables.pack(of_kind), [(locate, arguments, NOTHING)])
        for of_kind in surfaces.values()
    ]
    return tables.table(rows, 1)


def derivative_methods(
    tables: MethodTables, scene: Scene, placements: Placements
) -> NDArray[np.int64]:
    """Return the methods that compute dp/du and dp/dv, for each kind of shape."""
    work = work_types()
    arguments = (record_type(placements), work.hits, COLUMN, work.points, INT, INT, INT)
    shapes = scene.description.every_shape
    rows = []
    for kind, surfaces in scene.surfaces.items():
        of_kind = [shape for shape in shapes if kind_of_shape(shape).name == kind]
        record = tables.pack(SHAPES[kind].derivatives_of(surfaces, of_kind))
        rows.append((record, [(derive, arguments, NOTHING)]))
    return tables.table(rows, 1)
