"""Methods of lights: sampling of each kind, and emission found by BSDF samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer.plugins.shapes.registry  # noqa: F401  (registers the shapes' kernels)
from renderer.integrators.stages.emission import (
    add_emission_but_caustics,
    add_environment_but_caustics,
)
from renderer.kernels.jit import record_type
from renderer.kernels.records.kernel_scene import Lights, Methods, Settings, Shapes
from renderer.plugins.lights.area import add_emission, emitted_light, lamp_densities
from renderer.plugins.lights.choice import (
    LightChoice,
    choose_by_importance,
    weigh_found_lights,
)
from renderer.plugins.lights.environment import (
    add_environment,
    environment_light,
    sky_densities,
)
from renderer.plugins.lights.kind import LightKind, sample_lights_of
from renderer.plugins.lights.light_tree import light_choice
from renderer.plugins.lights.registry import plugin_of
from renderer.rendering.tables.methods import (
    COLUMN,
    INT,
    NOTHING,
    ROWS,
    MethodSpec,
    MethodTables,
    work_types,
)
from renderer.scene.light_order import light_order
from renderer.scene.light_properties import sampled_lights
from renderer.scene.light_tables import LightTables, light_bounds, lit_sides
from renderer.scene.materials import kind_of
from renderer.scene.scene import Scene

_NO_CHOICE = np.zeros((0, 3), np.int64)
_NO_IDS = np.zeros(0, np.int32)
NO_LIGHTS = Lights(
    0, np.zeros(1, np.int32), _NO_IDS, np.zeros((0, 6), np.int64), _NO_CHOICE
)


def light_methods(
    tables: MethodTables,
    lights: LightTables,
    settings: Settings,
    shapes: Shapes,
    arithmetic: Any,
    lit: bool,
    choice: LightChoice | None,
    caustics: bool,
    sampled: NDArray[np.int32],
    through_panes: bool,
) -> Lights:
    """Return the tables of all lights.

    `lit`: light samples are taken; otherwise only rays that hit lights find them. `choice`
    selects one of several lights at a point; None: all of them, or one uniformly.
    `caustics`: emission is added on caustic paths too. `sampled` are the ids of the lights
    that are sampled. `through_panes`: the light-sampling pdf is also needed where no BSDF
    sample has hit.
    """
    work = work_types()
    given = (record_type(settings), record_type(NO_LIGHTS))
    sample = (sample_lights_of, (work.points, ROWS, work.light_samples, INT), NOTHING)
    arriving = (*given, record_type(shapes), work.points, INT, ROWS)
    emission = (add_emission if caustics else add_emission_but_caustics, arriving, NOTHING)
    sky_kernel = add_environment if caustics else add_environment_but_caustics
    paths = (*given, work.points, work.rays, work.hits)
    sky = (sky_kernel, (*paths, INT, INT, ROWS), NOTHING)
    lamp = (lamp_densities, arriving, NOTHING)
    no_lamp = (sky_densities, (*paths, INT, ROWS), NOTHING)
    rows = []
    for k, table in enumerate(lights.tables):
        is_sampled = k in lights.kind[sampled]
        methods = [
            sample if lit and is_sampled else None,
            emission if emitted_light.has(type(table)) else None,
            sky if environment_light.has(type(table)) else None,
            lamp if through_panes and emitted_light.has(type(table)) else None,
            no_lamp if through_panes and environment_light.has(type(table)) else None,
        ]
        record = LightKind(table, k, lights.kind, arithmetic, float(is_sampled))
        rows.append((tables.pack(record), methods))
    chosen = (
        _NO_CHOICE if choice is None else _choice_methods(tables, choice, shapes, settings)
    )
    return Lights(lights.count, lights.kind, sampled, tables.table(rows, 5), chosen)


def _choice_methods(
    tables: MethodTables, choice: LightChoice, shapes: Shapes, settings: Settings
) -> Methods:
    """Return the row of methods that select a light; MIS weights need the second one."""
    work = work_types()
    points, rays = work.points, work.rays
    found = (record_type(shapes), COLUMN, points, rays, work.hits, INT, INT)
    methods: list[MethodSpec | None] = [
        (choose_by_importance, (points, INT, ROWS, COLUMN), NOTHING),
        (weigh_found_lights, found, NOTHING) if settings.weigh else None,
    ]
    return tables.table([(tables.pack(choice), methods)], 2)


def choice_of_light(
    scene: Scene, by_pair: bool, by_place: bool, finds_sky: bool
) -> LightChoice | None:
    """Return the table for selecting one of several lights; None: uniformly.

    `by_pair`: the first random number is better stratified than the fourth. `by_place`:
    select by position alone. `finds_sky`: a constant environment takes no light samples.
    """
    sides = [lit_sides(kind_of(bsdf)) for bsdf in scene.materials.bsdfs]
    bounds = light_bounds(scene)
    sampled = sampled_lights(scene.description, finds_sky)
    if len(sampled) < 2:
        return None
    order, emitters = light_order(scene.description), scene.description.emitters
    skies = [plugin_of(emitter).environment for emitter in emitters]
    environment = order.of_emitters[skies.index(True)] if any(skies) else -1
    if environment not in sampled:
        environment = -1
    return light_choice(
        bounds, sides, environment, by_pair=by_pair, by_place=by_place, sampled=sampled
    )
