"""Methods of shapes: rays through accelerators, and surface points of what they hit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types
from numpy.typing import NDArray

from renderer.accelerators.dispatch import TRAVERSALS
from renderer.accelerators.groups.accelerators import Accelerators
from renderer.jit import record_type
from renderer.records.kernel_scene import Placements, Primitives, Settings, Shapes
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.methods import (
    COLUMN,
    INT,
    NOTHING,
    MethodSpec,
    MethodTables,
    work_types,
)
from renderer.stages.surface import locate


def group_methods(
    tables: MethodTables, accelerators: Accelerators, plan: Plan, lit: bool
) -> NDArray[np.int64]:
    """Return the methods that trace rays through accelerators.

    `lit`: shadow rays are cast.
    """
    work = work_types()
    tally = types.Array(types.int32, 2, "C") if plan.kind.counts_work else NOTHING
    closest = (work.rays, work.hits, INT, INT, tally)
    blocked = (work.shadow_rays, INT, NOTHING)
    rows = []
    for accelerator in accelerators:
        if accelerator is None:
            continue
        t = TRAVERSALS[type(accelerator)]
        methods: list[MethodSpec | None] = [(t.closest_hit_coherent, closest, NOTHING)]
        deep = plan.max_depth > 1
        methods.append((t.closest_hit, closest, NOTHING) if deep else None)
        if lit:
            methods.append((t.any_hit_coherent, blocked, NOTHING))
            methods.append((t.any_hit, blocked, NOTHING))
        rows.append((tables.pack(accelerator), methods))
    return tables.table(rows, 4)


def surface_methods(
    tables: MethodTables,
    surfaces: dict[str, Any],
    settings: Settings,
    primitives: Primitives,
    shapes: Shapes,
    placements: Placements,
) -> NDArray[np.int64]:
    """Return the methods that turn hits into surface points."""
    work = work_types()
    arguments = (
        *(record_type(record) for record in (settings, primitives, shapes, placements)),
        work.rays,
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
