"""`Variant`: what differs bit by bit between normal rendering and a replay of Mitsuba.

The default is `RenderMode`. A replay of Mitsuba's random numbers and rounding is a second
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
    """Interface of a render mode."""

    arithmetic: Any  # see `renderer.plugins.sampling.numbers_and_warps`
    previous_points: bool  # whether rays keep the exact position where they start
    in_order: bool  # whether the samples of a tile must be drawn sequentially

    def of_lights(self, media: bool) -> Any:
        """Return the arithmetic of lights; `media`: rays may pass surfaces unscattered.

        In that case pdfs are relative to the last scattering event.
        """

    def traced(
        self, scene: Scene, plan: Plan, record: Any, sampler: Any
    ) -> tuple[Any, Packed]:
        """Return the kernel that traces the paths of a tile, and its record.

        `record` is the kernels' record of the scene, `sampler` that of the random numbers.
        """

    def instead(self, plan: Plan) -> Mapping[Any, Any]:
        """Return replacements for methods of stages: kernel -> the other one."""

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Return the source of random numbers."""

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return the surfaces of the scene, perhaps with other rounding."""

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Return the table that selects a triangle of a mesh light."""

    def lights(self, scene: Scene, lights: LightTables) -> LightTables:
        """Return the lights of the scene, perhaps with other rounding."""

    def parameters(self, materials: MaterialTables) -> NDArray[np.float32]:
        """Return the constant parameters of BSDFs, (rows, BSDFs)."""

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Return (kernel, record) of additional methods after stages.

        The first is called after camera rays, the second after scattering (None for
        nothing), all others after the surface points are computed.
        """


class RenderMode:
    """The mode of normal rendering."""

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
        """Return no replacements."""
        return {}

    def sampling(self, scene: Scene, plan: Plan, seed: int) -> Sampling:
        """Return hashed random numbers of pixel, sample and dimension."""
        record = kernel_sampler(plan, seed)
        by_pair = isinstance(record, Sobol) or getattr(record, "multi", None) is not None
        return Sampling(pack(record), draw_film, draw, choose_light, draw_aperture, by_pair)

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return the surfaces unchanged."""
        return surfaces

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Return alias tables: constant time."""
        return alias_tables(count, surfaces, tables)

    def lights(self, scene: Scene, lights: LightTables) -> LightTables:
        """Return the lights unchanged."""
        return lights

    def parameters(self, materials: MaterialTables) -> NDArray[np.float32]:
        """Return the parameters as they were read."""
        return materials.values()

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Return no additional methods."""
        return [(None, None)] * 2


def kernel_sampler(plan: Plan, seed: int) -> Any:
    """Return the sampler's record; its seed mixes the file's and the render's seed."""
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
    """Return the mode for a plan; `measured_camera` is only used by a replay."""
    if not plan.replay:
        return RenderMode()
    from renderer.replay.replay_mode import Replayed

    return Replayed(measured_camera, RULES[plan.mitsuba_version])
