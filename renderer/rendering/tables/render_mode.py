"""What may differ from one way of rendering to another, down to the last bit.

The default is `RenderMode`. A replay of Mitsuba's random numbers and roundings is a second
implementation (`renderer.replay`), which only `mode_for` imports.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.camera_rays import (
    choose_light,
    draw,
    draw_aperture,
    draw_film,
)
from renderer.kernels.jit import Packed, pack
from renderer.mitsuba_version import RULES
from renderer.plugins.sampling.numbers_and_warps import (
    FromLastEvent,
    Independent,
    Plain,
    Sampling,
    Stratified,
)
from renderer.plugins.sampling.sobol import Sobol, make_sobol
from renderer.rendering.planning.plan import Plan, stratified_cells
from renderer.scene.light_tables import LightTables, alias_tables
from renderer.scene.materials import MaterialTables
from renderer.scene.scene import Scene


class Variant(Protocol):
    """One way of rendering."""

    arithmetic: Any  # see `renderer.plugins.sampling.numbers_and_warps`
    previous_points: bool  # whether rays keep the exact positions that they come from
    in_order: bool  # whether the samples of a tile must be drawn one after the other

    def of_lights(self, media: bool) -> Any:
        """Return the arithmetic of lights; `media`: paths go straight on through surfaces.

        The point that a path comes from is then that where it was scattered last.
        """

    def traced(
        self, scene: Scene, plan: Plan, record: Any, sampler: Any
    ) -> tuple[Any, Packed]:
        """Return the kernel that traces the paths of a tile, and the record it works on.

        `record` and `sampler` are the kernels' own of the scene and of the numbers.
        """

    def instead(self, plan: Plan) -> Mapping[Any, Any]:
        """Return the methods of stages that others stand in for: kernel -> the other."""

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Return the source of random numbers."""

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return the surfaces of the scene, more exactly rounded where it matters."""

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Return the table by which a triangle of a mesh light is chosen."""

    def lights(self, scene: Scene, lights: LightTables) -> LightTables:
        """Return the lights of the scene, more exactly rounded where it matters."""

    def parameters(self, materials: MaterialTables) -> NDArray[np.float32]:
        """Return the constant parameters of BSDFs, (rows, BSDFs)."""

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Return (kernel, record) of what is done after stages.

        After camera rays, then after scattering, None for nothing; all others are called
        after the surface points are found.
        """


class RenderMode:
    """The renderer's own."""

    arithmetic = Plain()
    previous_points = False
    in_order = False

    def of_lights(self, media: bool) -> Any:
        """Return the plain formulas."""
        return FromLastEvent() if media else self.arithmetic

    def traced(
        self, scene: Scene, plan: Plan, record: Any, sampler: Any
    ) -> tuple[Any, Packed]:
        """Return the integrator's own loop."""
        return plan.trace, pack(record)

    def instead(self, plan: Plan) -> Mapping[Any, Any]:
        """Return none."""
        return {}

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Hash pixel, sample and dimension."""
        record = kernel_sampler(plan, seed)
        by_pair = isinstance(record, Sobol) or getattr(record, "multi", None) is not None
        return Sampling(pack(record), draw_film, draw, choose_light, draw_aperture, by_pair)

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return them as they are."""
        return surfaces

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Choose in constant time."""
        return alias_tables(count, surfaces, tables)

    def lights(self, scene: Scene, lights: LightTables) -> LightTables:
        """Return them as they are."""
        return lights

    def parameters(self, materials: MaterialTables) -> NDArray[np.float32]:
        """Return them as they were read."""
        return materials.values()

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Do nothing more."""
        return [(None, None)] * 2


def kernel_sampler(plan: Plan, seed: int) -> Any:
    """Return the sampler's record; the file's own seed and the render's are mixed."""
    mixed = int(np.random.SeedSequence([plan.sampler.seed, seed]).generate_state(1)[0])
    name = plan.sampler.name
    if name == "independent":
        return Independent(mixed)
    if name == "sobol":
        return make_sobol(mixed, plan.spp)
    columns, rows = stratified_cells(plan.spp)
    jitter = 1.0 if plan.sampler.jitter else 0.0
    return Stratified(mixed, columns, rows, jitter, None if name == "stratified" else 1)


def mode_for(plan: Plan, measured_camera: Sequence[float] | None) -> Variant:
    """Return the way of rendering of a plan; `measured_camera` is for a replay."""
    if not plan.replay:
        return RenderMode()
    from renderer.replay.replay_mode import Replayed

    return Replayed(measured_camera, RULES[plan.mitsuba_version])
