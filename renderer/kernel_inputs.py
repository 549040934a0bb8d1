"""From scene and plan to the kernels' record: tables of what is needed, and its methods.

Each kind of shape, BSDF, texture and light that the scene has becomes a row with its record
and the addresses of its kernels, compiled here for just those records.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import typeof
from numba.core import types

import renderer.lights.directional
import renderer.lights.point
import renderer.lights.spheres
import renderer.lights.spot  # noqa: F401  (they make their kernels known)
from renderer.accelerators.build import build_accelerators
from renderer.accelerators.dispatch import TRAVERSALS
from renderer.arithmetic import Plain
from renderer.batch import Workspace, make_workspace
from renderer.bsdfs.kind import BsdfKind, BsdfMethods
from renderer.camera import kernel_camera
from renderer.integrators.first_hit import show_albedo
from renderer.jit import Packed, compile_method, pack, record_type
from renderer.kernel_scene import (
    AreaLights,
    Bsdfs,
    ConstantLights,
    KernelScene,
    LightKind,
    Lights,
    Placements,
    Primitives,
    Settings,
)
from renderer.light_order import light_order
from renderer.light_tables import alias_tables, light_tables
from renderer.lights.area import add_emission
from renderer.lights.constant import add_constant
from renderer.lights.kind import sample_lights_of
from renderer.plan import NO_LIMIT, RAY_OFFSETS, Plan, stratified_cells
from renderer.sampling import Independent, Stratified
from renderer.scene import Scene
from renderer.stages.direct_light import reflect_light
from renderer.stages.draws import choose_light, draw, draw_film
from renderer.stages.scatter import scatter_kind
from renderer.stages.split import split_glass, split_mirror
from renderer.stages.surface import locate
from renderer.stages.tile import Tile
from renderer.textures.kind import TextureMethods
from renderer.textures.look_up import look_up_kind
from renderer.textures.registry import TEXTURES

INT, FLOAT = types.int64, types.float32
COLUMN = types.Array(types.int32, 1, "C")  # integers by column
ROWS = types.Array(types.float32, 2, "C")
TILE = typeof(Tile(0, 0, 1, 1, 1))
NO_PLACEMENTS = Placements(*(np.zeros(0, t) for t in ("f4", "f4", "i4", "i4")))


@functools.cache
def work_types() -> Any:
    """Return the Numba types of what is in a thread's workspace, by the same names."""
    work = make_workspace(ray_capacity=16, capacity=16)
    return Workspace._make(
        typeof(part) if not isinstance(part, tuple) else record_type(part) for part in work
    )


@dataclass(frozen=True)
class Sampling:
    """Where random numbers come from, as methods of a record."""

    record: Packed
    film: Any  # kernels of `stages.draws`, or others with the same parameters
    draw: Any
    choose_light: Any
    begin_bounce: Any = None  # None: numbers need not be drawn in order


class Variant(Protocol):
    """What may differ from one way of rendering to another, down to the last bit."""

    arithmetic: Any
    previous_points: bool  # whether rays keep the exact positions that they come from

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Return the source of random numbers."""

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return the surfaces of the scene, more exactly rounded where it matters."""

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Return the table by which a triangle of a mesh light is chosen."""

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Return (kernel, record) of what is done after stages; None for nothing."""


class OwnWay:
    """The renderer's own."""

    arithmetic = Plain()
    previous_points = False

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Mix the file's own seed and the render's."""
        return Sampling(pack(kernel_sampler(plan, seed)), draw_film, draw, choose_light)

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return them as they are."""
        return surfaces

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Choose in constant time."""
        return alias_tables(count, surfaces, tables)

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Do nothing more."""
        return [(None, None)] * 3


def kernel_sampler(plan: Plan, seed: int) -> Any:
    """Return the sampler's record; the file's own seed and the render's are mixed."""
    mixed = int(np.random.SeedSequence([plan.sampler.seed, seed]).generate_state(1)[0])
    name = plan.sampler.name
    if name == "independent":
        return Independent(mixed)
    columns, rows = stratified_cells(plan.spp)
    jitter = 1.0 if plan.sampler.jitter else 0.0
    return Stratified(mixed, columns, rows, jitter, None if name == "stratified" else 1)


class SceneTables:
    """Builds the kernels' record of a scene, and keeps alive what addresses point to."""

    def __init__(self, scene: Scene, plan: Plan, variant: Variant) -> None:
        self.scene, self.plan, self.variant = scene, plan, variant
        self.kept: list[Packed] = []
        self.settings = _settings(plan, scene, variant)
        order = light_order(scene.description)
        has_lights = bool(order.of_emitters) or max(order.of_shapes, default=-1) >= 0
        self.lit = plan.asks_lights and scene.materials.smooth and has_lights
        surfaces = variant.surfaces(scene.surfaces)
        if not self.settings.with_uv and "triangles" in surfaces:
            no_uvs = np.zeros((6, 0), np.float32)
            triangles = surfaces["triangles"]._replace(uvs=no_uvs)
            surfaces = surfaces | {"triangles": triangles}
        self.surfaces = surfaces
        self.placements = scene.placements or NO_PLACEMENTS
        self.primitives = Primitives(scene.stages, scene.shape, scene.face)

    def pack(self, record: Any, source: str = "") -> Packed:
        """Pack a record that kernels will be given the address of."""
        packed = pack(record, source)
        self.kept.append(packed)
        return packed

    def methods(
        self, rows: Sequence[tuple[Packed | None, Sequence[Any]]], columns: int
    ) -> Any:
        """Return a table of methods; a row is a record and (kernel, types, returns)."""
        table = np.zeros((len(rows), 1 + columns), np.int64)
        for k, (record, kernels) in enumerate(rows):
            for column, method in enumerate(kernels, start=1):
                if method is not None and record is not None:
                    kernel, arguments, returns = method
                    compiled = compile_method(kernel, record, *arguments, returns=returns)
                    table[k, 0], table[k, column] = record.address, compiled.address
        return table

    # --------------------------------------------------------------- what to intersect

    def groups(self, accelerators: Any) -> Any:
        """Return the methods that trace rays through accelerators."""
        work = work_types()
        tally = types.Array(types.int32, 2, "C") if self.plan.counts_work else types.none
        closest = (work.rays, work.hits, INT, INT, tally)
        blocked = (work.shadow_rays, INT, types.none)
        rows = []
        for accelerator in accelerators:
            if accelerator is None:
                continue
            t = TRAVERSALS[type(accelerator)]
            shadows = [t.any_hit_coherent, t.any_hit] if self.lit else []
            rows.append(
                (
                    self.pack(accelerator),
                    [
                        (t.closest_hit_coherent, closest, types.none),
                        (t.closest_hit, closest, types.none)
                        if self.plan.max_depth > 1
                        else None,
                        *((kernel, blocked, types.none) for kernel in shadows),
                    ],
                )
            )
        return self.methods(rows, 4)

    def surface_methods(self) -> Any:
        """Return the methods that turn hits into surface points."""
        work = work_types()
        arguments = (
            record_type(self.settings),
            record_type(self.primitives),
            record_type(self.scene.shapes),
            record_type(self.placements),
            work.rays,
            work.hits,
            COLUMN,
            INT,
            work.points,
        )
        rows = [
            (self.pack(surfaces), [(locate, arguments, types.none)])
            for surfaces in self.surfaces.values()
        ]
        return self.methods(rows, 1)

    # ----------------------------------------------------------------------- materials

    def bsdfs(self) -> Bsdfs:
        """Return the tables of the BSDFs that the plan's paths go on from."""
        materials = self.scene.materials
        kinds, texture_kinds = materials.kinds, list(TEXTURES.values())
        textures = materials.textures()
        texture_kinds = [
            kind
            for kind in texture_kinds
            if any(isinstance(texture, kind.description) for texture in textures)
        ]
        methods = self.methods([self._bsdf_row(kind) for kind in kinds], 4)
        needed = [kind if methods[k, 0] else None for k, kind in enumerate(kinds)]
        values = materials.values()
        named = {kind.name: k for k, kind in enumerate(kinds)}
        bsdfs = Bsdfs(
            methods,
            sum(kind.smooth for kind in kinds),
            np.array([named[b.plugin] for b in materials.bsdfs] or [-1], np.int32),
            values,
            np.array([kind.row_count for kind in kinds], np.int32),
            materials.look_ups(needed, texture_kinds),
            materials.texture_ids(),
            np.array(
                [
                    next(
                        k
                        for k, kind in enumerate(texture_kinds)
                        if isinstance(texture, kind.description)
                    )
                    for texture in textures
                ],
                np.int32,
            ),
            np.zeros((0, 2), np.int64),
        )
        look_up = (record_type(bsdfs), INT, INT, INT, work_types().points, INT, INT)
        to_uv = np.array([t.to_uv[:2].ravel() for t in textures], np.float32).reshape(-1, 6)
        rows = [
            (
                self.pack(
                    TextureMethods(
                        kind.table(
                            [
                                t if isinstance(t, kind.description) else None
                                for t in textures
                            ]
                        ),
                        np.ascontiguousarray(to_uv.T),
                    )
                ),
                [(look_up_kind, look_up, types.none)],
            )
            for kind in (texture_kinds if bsdfs.look_ups.size else [])
        ]
        return bsdfs._replace(texture_methods=self.methods(rows, 1))

    def _bsdf_row(self, kind: BsdfKind) -> tuple[Packed, list[Any]]:
        plan, work = self.plan, work_types()
        settings = record_type(self.settings)
        lit = kind.smooth and self.lit
        tree = kind.delta and plan.mirrors and plan.method == "whitted"
        on = plan.method in ("path", "direct") and (
            (kind.smooth and plan.follow) or (kind.delta and plan.mirrors)
        )
        group = (work.points, INT, INT)
        reflect = (
            settings,
            FLOAT,
            work.points,
            work.light_samples,
            INT,
            INT,
            work.shadow_rays,
            INT,
        )
        scatter = (settings, INT, work.points, ROWS, INT, INT, work.rays, INT)
        split = (settings, *group, work.rays, INT)
        form = kind.form()
        return self.pack(BsdfMethods(form, self.variant.arithmetic), kind.source), [
            (reflect_light, reflect, INT) if lit else None,
            (scatter_kind, scatter, INT) if on else None,
            (split_glass if kind.transmission else split_mirror, split, INT)
            if tree
            else None,
            (show_albedo, (work.points, INT, ROWS), types.none)
            if kind.albedo is not None and plan.method in ("aov", "depth")
            else None,
        ]

    # -------------------------------------------------------------------------- lights

    def lights(self) -> Lights:
        """Return the tables of all lights, none for a method that looks at none."""
        if not self.plan.sees_lights:
            return Lights(0, np.zeros(1, np.int32), np.zeros((0, 4), np.int64))
        tables = light_tables(self.scene, self.variant.mesh_choice)
        if tables.count == 0:
            return Lights(0, tables.kind, np.zeros((0, 4), np.int64))
        work, settings = work_types(), record_type(self.settings)
        none = Lights(0, tables.kind, np.zeros((1, 4), np.int64))
        lights = record_type(none)
        shapes = record_type(self.scene.shapes)
        sample = (work.points, ROWS, work.light_samples, INT)
        emission = (settings, lights, shapes, work.points, INT, ROWS)
        sky = (settings, lights, work.rays, work.hits, INT, INT, ROWS)
        rows: list[tuple[Packed | None, list[Any]]] = []
        for k, table in enumerate(tables.tables):
            if isinstance(table, AreaLights):
                table = table._replace(surfaces=self._surfaces_like(table.surfaces))
            record = self.pack(LightKind(table, k, tables.kind, self.variant.arithmetic))
            area, constant = (
                isinstance(table, AreaLights),
                isinstance(table, ConstantLights),
            )
            rows.append(
                (
                    record,
                    [
                        (sample_lights_of, sample, types.none) if self.lit else None,
                        (add_emission, emission, types.none) if area else None,
                        (add_constant, sky, types.none) if constant else None,
                    ],
                )
            )
        return Lights(tables.count, tables.kind, self.methods(rows, 3))

    def _surfaces_like(self, surfaces: Any) -> Any:
        """Return the surfaces that the kernels see for those of the scene."""
        for kind, given in self.scene.surfaces.items():
            if given is surfaces:
                return self.surfaces[kind]
        return surfaces

    # ------------------------------------------------------------------- numbers, hooks

    def sampler(self, seed: int) -> Any:
        """Return the one row of methods of the sampler."""
        sampling = self.variant.sampling(self.scene, self.plan, seed)
        self.sampler_record = sampling.record
        work = work_types()
        begin = (COLUMN, TILE, INT, work.rays, work.hits, INT)
        draws = (TILE, INT, INT, COLUMN, INT, ROWS)
        choice = (TILE, INT, INT, INT, INT, COLUMN, INT, ROWS, COLUMN)
        shades = self.plan.method in ("path", "direct")
        return self.methods(
            [
                (
                    sampling.record,
                    [
                        (sampling.film, (TILE, INT, ROWS), types.none),
                        (sampling.begin_bounce, begin, types.none)
                        if sampling.begin_bounce is not None and shades
                        else None,
                        (sampling.draw, draws, types.none) if shades else None,
                        (sampling.choose_light, choice, types.none) if self.lit else None,
                    ],
                )
            ],
            4,
        )

    def hooks(self) -> Any:
        """Return what is done after stages."""
        work = work_types()
        placements, settings = record_type(self.placements), record_type(self.settings)
        arguments = (
            (work.rays, INT, ROWS),
            (placements, work.rays, work.hits, COLUMN, INT, work.points),
            (settings, work.rays, INT, work.points),
        )
        given = self.variant.hooks(self.scene, self.surfaces)
        rows: list[tuple[Packed | None, list[Any]]] = [
            (
                None if kernel is None else self.pack(record),
                [None if kernel is None else (kernel, types_, types.none)],
            )
            for (kernel, record), types_ in zip(given, arguments, strict=True)
        ]
        return self.methods(rows, 1)


def _settings(plan: Plan, scene: Scene, variant: Variant) -> Settings:
    first_hit = plan.method in ("depth", "aov")
    with_uv = (scene.materials.textured or first_hit) and not plan.counts_work
    return Settings(
        plan.max_depth,
        NO_LIMIT if plan.roulette_depth is None else plan.roulette_depth,
        int(plan.weigh),
        int(plan.every_light),
        int(plan.hide_emitters),
        int(with_uv),
        int(variant.previous_points),
        float(plan.cutoff),
        *(float(x) for x in RAY_OFFSETS[plan.ray_offset]),
    )


def kernel_scene(scene: Scene, plan: Plan, accel: str, seed: int, variant: Variant) -> Any:
    """Assemble what the kernels of a plan may look at.

    Returns
    -------
    KernelScene, SceneTables
        The tables must be kept alive as long as the record is used.
    """
    tables = SceneTables(scene, plan, variant)
    accelerators = build_accelerators(scene, accel, plan.rays)
    groups = camera_groups = tables.groups(accelerators)
    if plan.hide_emitters:
        seen = build_accelerators(scene, accel, plan.rays, without_emitters_of=accelerators)
        camera_groups = tables.groups(seen)
    record = KernelScene(
        groups,
        camera_groups,
        tables.surface_methods(),
        tables.placements,
        tables.primitives,
        scene.shapes,
        tables.bsdfs(),
        tables.lights(),
        kernel_camera(scene.description.camera),
        tables.sampler(seed),
        tables.hooks(),
        tables.settings,
    )
    return record, tables
