"""Methods of lights: how each kind is sampled, and what paths find that arrive at it."""

from __future__ import annotations

from typing import Any

import numpy as np

import renderer.kinds.shapes.registry  # noqa: F401  (shapes make their kernels known)
from renderer.kernels.jit import record_type
from renderer.kernels.records.kernel_scene import Lights, Settings, Shapes
from renderer.kinds.lights.area import add_emission, emitted_light
from renderer.kinds.lights.environment import add_environment, environment_light
from renderer.kinds.lights.kind import LightKind, sample_lights_of
from renderer.rendering.tables.methods import INT, NOTHING, ROWS, MethodTables, work_types
from renderer.scene.light_tables import LightTables
from renderer.stages.caustics import (
    add_emission_but_caustics,
    add_environment_but_caustics,
)

NO_LIGHTS = Lights(0, np.zeros(1, np.int32), np.zeros((0, 4), np.int64))


def light_methods(
    tables: MethodTables,
    lights: LightTables,
    settings: Settings,
    shapes: Shapes,
    arithmetic: Any,
    lit: bool,
    caustics: bool,
) -> Lights:
    """Return the tables of all lights.

    `lit`: they are sampled; else they shine only on those who look at them. `caustics`:
    on those paths too.
    """
    work = work_types()
    given = (record_type(settings), record_type(NO_LIGHTS))
    sample = (sample_lights_of, (work.points, ROWS, work.light_samples, INT), NOTHING)
    arriving = (*given, record_type(shapes), work.points, INT, ROWS)
    emission = (add_emission if caustics else add_emission_but_caustics, arriving, NOTHING)
    sky_kernel = add_environment if caustics else add_environment_but_caustics
    sky = (sky_kernel, (*given, work.rays, work.hits, INT, INT, ROWS), NOTHING)
    rows = []
    for k, table in enumerate(lights.tables):
        methods = [
            sample if lit else None,
            emission if emitted_light.has(type(table)) else None,
            sky if environment_light.has(type(table)) else None,
        ]
        rows.append((tables.pack(LightKind(table, k, lights.kind, arithmetic)), methods))
    return Lights(lights.count, lights.kind, tables.table(rows, 3))
