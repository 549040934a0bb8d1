"""The kernels' record of a scene and a plan, without rows for what is not used."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import (
    accelerators_of_camera,
    accelerators_of_lamps,
    accelerators_of_panes,
    accelerators_of_shadow_rays,
    build_accelerators,
)
from renderer.accelerators.choice import USUAL_RAYS, choose_structures
from renderer.integrators.kind import NO_LIMIT
from renderer.integrators.stages.camera_rays import fill_rays
from renderer.integrators.stages.emission import CausticMarks, mark_caustics
from renderer.integrators.stages.surface import Previous, keep_previous_points
from renderer.kernels.jit import Packed, record_type
from renderer.kernels.records.kernel_scene import (
    AFTER_SCATTERING,
    AFTER_SURFACE_POINTS,
    KernelScene,
    Placements,
    Primitives,
    Settings,
)
from renderer.plugins.lights.sky_by_place import NOWHERE
from renderer.plugins.sampling.numbers_and_warps import Sampling
from renderer.plugins.sensors.registry import kind_of_sensor
from renderer.plugins.shapes.registry import SHAPES
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.bsdfs import bsdf_tables
from renderer.rendering.tables.geometry import (
    derivative_methods,
    group_methods,
    shadow_methods,
    surface_methods,
)
from renderer.rendering.tables.lights import (
    NO_LIGHTS,
    choice_of_light,
    light_methods,
)
from renderer.rendering.tables.methods import (
    COLUMN,
    INT,
    NOTHING,
    ROWS,
    TILE,
    MethodTables,
    work_types,
)
from renderer.rendering.tables.render_mode import Variant
from renderer.rendering.tables.seen_sky import seen_sky
from renderer.rendering.user_kernels.check import (
    check_kernels_of_users,
    check_values_of_users,
)
from renderer.scene.fog_lamps import fog_lamps
from renderer.scene.light_order import light_order
from renderer.scene.light_properties import (
    has_extended_lights,
    has_textured_lamps,
    sampled_lights,
)
from renderer.scene.light_tables import light_tables
from renderer.scene.media_tables import media_tables
from renderer.scene.scene import Scene
from renderer.scene_file.description import Sampler, Sensor

_NO_METHODS = np.zeros((1, 1), np.int64)
_NO_LAMPS = np.zeros((5, 0), np.float32)
_NO_PLACEMENTS = Placements(*(np.zeros(0, t) for t in ("f4", "f4", "i4", "i4")))


class KernelInputs:
    """The kernels' inputs for a plan.

    Attributes
    ----------
    record : KernelScene
        Its addresses point to arrays that this object keeps alive.
    sampler : Packed
        The record of the source of random numbers.
    surfaces : dict
        Kind of shape -> its record.
    """

    def __init__(
        self, scene: Scene, plan: Plan, accel: str, seed: int, variant: Variant
    ) -> None:
        sampling = variant.sampling(scene, plan, seed)
        self.sampler: Packed = sampling.record
        what = (scene, plan, accel, variant, sampling.by_pair)
        if variant.in_order:  # a replay: its tables depend on more than the plan
            self._tables = _SceneTables(*what)
        else:
            key = _what_decides(scene, plan, accel), sampling.by_pair
            self._tables = scene.recently("tables", key, _SceneTables, *what)
        self._own = MethodTables()
        self.surfaces = self._tables.surfaces
        chooses = self._tables.chooses
        methods = _sampler_methods(self._own, sampling, scene, plan, chooses)
        self.record = self._tables.record._replace(sampler=methods)
        # time of compiling the methods; 0 for cached ones
        kept = self._tables.methods
        self.compile_seconds = self._own.compile_seconds + kept.compile_seconds
        kept.compile_seconds = 0.0

    @property
    def kept(self) -> list[Packed]:
        """Records that methods have the addresses of."""
        return self._tables.methods.kept + self._own.kept


def _what_decides(scene: Scene, plan: Plan, accel: str) -> tuple[Any, ...]:
    """Return what the tables depend on; not the number or seed of the samples."""
    chosen = choose_structures(scene, accel, plan.rays)
    structures = tuple((kind, choice.name) for kind, choice in chosen.items())
    sampler = Sampler("independent", 1)
    same = dataclasses.replace(plan, spp=1, sampler=sampler, rays=USUAL_RAYS, lines=())
    return accel, structures, same


class _SceneTables:
    """All tables that do not depend on the random numbers; shared between seeds.

    Attributes
    ----------
    record : KernelScene
        Without the methods of the sampler.
    methods : MethodTables
        Keeps alive what the addresses in `record` point to.
    surfaces : dict
        Kind of shape -> its record.
    chooses : bool
        Whether the sampler selects lights, uniformly.
    """

    def __init__(
        self, scene: Scene, plan: Plan, accel: str, variant: Variant, by_pair: bool
    ) -> None:
        self.methods = tables = MethodTables(variant.instead(plan))
        tables.prepare(check_kernels_of_users, scene.materials.kinds, variant.arithmetic)
        tables.prepare(check_values_of_users, scene.materials)
        settings = _settings(scene, plan, variant)
        self.surfaces = surfaces = _surfaces(scene, settings, variant)
        placements = scene.placements or _NO_PLACEMENTS
        primitives = Primitives(scene.stages, scene.shape, scene.face)
        scattering = scene.materials.smooth or plan.kind.media
        lit = plan.samples_lights and scattering and has_lights(scene)

        accelerators = build_accelerators(scene, accel, plan.rays)
        groups = camera_groups = group_methods(tables, accelerators, plan)
        if plan.hide_emitters:
            seen = accelerators_of_camera(scene, accel, plan.rays, accelerators)
            camera_groups = group_methods(tables, seen, plan)
        sampled = sampled_lights(scene.description, plan.finds_sky)
        shadow_groups = tables.table([], 2)
        if lit and not plan.kind.media:
            in_the_way = accelerators
            if not plan.replay:  # in a replay rounding must agree with Mitsuba
                in_the_way = accelerators_of_shadow_rays(
                    scene, accel, plan.rays, accelerators, sampled, plan.offset[:2]
                )
            lamps = has_extended_lights(scene.description, but_even_sky=plan.finds_sky)
            shadow_groups = shadow_methods(tables, in_the_way, lamps)

        pane_groups = lamp_groups = tables.table([], 2)
        if plan.through_panes:
            whole = scene, accel, plan.rays, accelerators
            pane_groups = shadow_methods(tables, accelerators_of_panes(*whole), True)
            lamp_groups = group_methods(tables, accelerators_of_lamps(*whole), plan)

        sensor = _sensor_methods(tables, scene.description.camera)
        lights, choice, places = NO_LIGHTS, None, NOWHERE
        if plan.kind.sees_lights and has_lights(scene):
            by_kind = light_tables(scene, surfaces, variant.mesh_choice)
            if lit and plan.sky_by_place:
                k, through = by_kind.kind_of_sky, plan.through_panes
                look = scene, sensor, groups, by_kind.tables[k], through
                sky = scene.once(("seen sky", through), seen_sky, *look)
                by_kind, places = by_kind.with_table(k, sky), sky.places
            if lit and plan.by_importance:
                how = by_pair, plan.kind.media, plan.finds_sky
                choice = scene.once(
                    ("choice of lights", *how), choice_of_light, scene, *how
                )
                choice = choice and choice._replace(places=places)
            lights = light_methods(
                tables,
                variant.lights(scene, by_kind),
                settings,
                scene.shapes,
                variant.of_lights(plan.kind.media),
                lit,
                choice,
                plan.caustics,
                sampled,
                plan.through_panes,
            )
        self.chooses = lit and choice is None
        hooks = variant.hooks(scene, surfaces)
        if not plan.caustics:  # never false for a replay
            hooks[AFTER_SCATTERING] = (mark_caustics, CausticMarks())
        if plan.kind.media and not variant.previous_points:  # a replay always has them
            hooks.append((keep_previous_points, Previous()))
        self.record = KernelScene(
            groups,
            camera_groups,
            shadow_groups,
            surface_methods(tables, surfaces, settings, scene.shapes, placements),
            placements,
            primitives,
            scene.shapes,
            bsdf_tables(
                tables,
                scene,
                plan,
                settings,
                variant.parameters(scene.materials),
                variant.arithmetic,
                lit,
                lambda: derivative_methods(tables, scene, placements),
            ),
            lights,
            sensor,
            _NO_METHODS,
            _hooks(tables, hooks, settings, placements),
            settings,
            media_tables(scene.description if plan.kind.media else None),
            pane_groups,
            lamp_groups,
            fog_lamps(scene) if plan.near_lamps else _NO_LAMPS,
        )


def has_lights(scene: Scene) -> bool:
    """Return whether the scene has any emitter."""
    order = light_order(scene.description)
    return bool(order.of_emitters) or max(order.of_shapes, default=-1) >= 0


def _settings(scene: Scene, plan: Plan, variant: Variant) -> Settings:
    kind = plan.kind
    textured = scene.materials.textured or has_textured_lamps(scene.description)
    with_uv = (textured or kind.first_hit) and not kind.counts_work
    roulette_depth = plan.roulette_depth or NO_LIMIT  # at least 1
    return Settings(
        plan.max_depth,
        roulette_depth,
        plan.dim_depth or roulette_depth,
        plan.survival_scale,
        int(plan.weigh),
        int(plan.every_light),
        int(plan.hide_emitters),
        int(plan.transparent),
        int(with_uv),
        int(variant.previous_points or scene.materials.oriented),
        plan.light_samples,
        plan.bsdf_samples,
        plan.light_share,
        float(plan.cutoff),
        plan.offset.rounding,
        plan.offset.fixed,
        1.0 - plan.offset.light_gap,
    )


def _surfaces(scene: Scene, settings: Settings, variant: Variant) -> dict[str, Any]:
    """Return the scene's surface tables, reduced to what the kernels read."""
    uv, tangents = bool(settings.with_uv), bool(settings.with_tangents)
    return {
        kind: SHAPES[kind].prepared(table, with_uv=uv, with_tangents=tangents)
        for kind, table in variant.surfaces(scene.surfaces).items()
    }


def _sensor_methods(tables: MethodTables, sensor: Sensor) -> NDArray[np.int64]:
    """Return the one row of methods of the sensor."""
    work = work_types()
    fill = (fill_rays, (TILE, work.rays, work.hits, ROWS, INT), INT)
    return tables.table([(tables.pack(kind_of_sensor(sensor).record(sensor)), [fill])], 1)


def _sampler_methods(
    tables: MethodTables, sampling: Sampling, scene: Scene, plan: Plan, chooses: bool
) -> NDArray[np.int64]:
    """Return the sampler's row of methods; `chooses`: it selects lights uniformly."""
    work = work_types()
    begin = (COLUMN, TILE, INT, work.rays, work.hits, INT)
    draws = (TILE, INT, INT, COLUMN, INT, ROWS)
    choice = (TILE, INT, INT, INT, INT, COLUMN, INT, ROWS, COLUMN)
    shades = plan.kind.scatters
    has_aperture = kind_of_sensor(scene.description.camera).has_aperture
    in_order = sampling.begin_bounce is not None and shades
    methods = [
        (sampling.film, (TILE, INT, ROWS), NOTHING),
        (sampling.begin_bounce, begin, NOTHING) if in_order else None,
        (sampling.draw, draws, NOTHING) if shades else None,
        (sampling.choose_light, choice, NOTHING) if chooses else None,
        (sampling.aperture, (TILE, INT, ROWS), NOTHING) if has_aperture else None,
    ]
    return tables.table([(sampling.record, methods)], 5)


def _hooks(
    tables: MethodTables,
    given: list[tuple[Any, Any]],
    settings: Settings,
    placements: Placements,
) -> NDArray[np.int64]:
    """Return the methods called after camera rays, scattering and surface points."""
    work = work_types()
    of_points = record_type(placements), work.rays, work.hits, COLUMN, INT, work.points
    arguments: tuple[tuple[Any, ...], ...] = (
        (work.rays, INT, ROWS),
        (record_type(settings), work.rays, INT, work.points),
        *(of_points for _ in given[AFTER_SURFACE_POINTS:]),
    )
    rows = [
        (None, [None])
        if kernel is None
        else (tables.pack(record), [(kernel, types, NOTHING)])
        for (kernel, record), types in zip(given, arguments, strict=True)
    ]
    return tables.table(rows, 1)
