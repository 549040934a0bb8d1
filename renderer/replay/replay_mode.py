"""The render mode that replays Mitsuba, and the scenes that it refuses."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.errors import NotReplayable
from renderer.integrators.kind import IntegratorKind
from renderer.kernels.jit import Packed, pack
from renderer.mitsuba_version import NEWEST, MitsubaRules
from renderer.plugins.lights.envmap import EnvironmentMaps
from renderer.plugins.lights.spot import SpotLights
from renderer.plugins.sampling.numbers_and_warps import Sampling
from renderer.plugins.sensors.registry import kind_of_sensor
from renderer.plugins.shapes.flat import replaced
from renderer.replay.camera import replay_camera, round_camera_rays
from renderer.replay.directions import AsMitsuba
from renderer.replay.environment import rounded_environment
from renderer.replay.exact_hits import face_normals, triangle_tangents
from renderer.replay.hit_points import hooks_of_hits
from renderer.replay.light_rounding import (
    rounded_shares,
    rounded_spots,
    sphere_around,
    triangle_shares,
)
from renderer.replay.media.carried import OfThroughput
from renderer.replay.media.record import ROWS_IN_MEDIA, in_order
from renderer.replay.media.spectral_mis import ROWS_OF_MIS, OfBothWays
from renderer.replay.media.trace import trace_in_order
from renderer.replay.media.weighed_stages import INSTEAD, INSTEAD_OF_ONE
from renderer.replay.new_rays import Leaving, round_rays
from renderer.replay.pixel_seeds import BLOCK_SIZE, pixel_seeds
from renderer.replay.sequences import (
    Replay,
    begin_bounce,
    choose_light,
    draw,
    draw_aperture,
    draw_film,
    make_sequence,
    rows_of,
)
from renderer.scene.light_order import light_order
from renderer.scene.light_tables import LightTables
from renderer.scene.materials import MaterialTables, kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import EnvironmentMap, Integrator, Sampler, SpotLight

# ----------------------------------------------------------------------------- refusals
# Scenes that cannot be replayed.

MOST_SAMPLES = 256  # of `direct` per point: 6 KB of numbers per pixel


def check_replay(requested: Integrator, method: str, extended: bool) -> None:
    """Refuse integrators whose order of random numbers in Mitsuba cannot be followed.

    Parameters
    ----------
    requested
        The integrator of the file.
    method
        Name of the integrator that runs.
    extended
        Whether lights have an extent.

    Raises
    ------
    NotReplayable
        With one line that gives the reason and what is possible.
    """
    if method == "work":
        raise NotReplayable(
            "sampler 'mitsuba': Mitsuba has no integrator that counts work; possible are "
            "path, direct, depth, aov and whitted"
        )
    integrators = (requested, requested.nested or requested)
    if any(i.block_size not in (0, BLOCK_SIZE) or not i.one_pass for i in integrators):
        raise NotReplayable(
            "sampler 'mitsuba': the file divides the work in its own way (block_size, "
            f"samples_per_pass); possible are block_size {BLOCK_SIZE} and a single pass"
        )
    if method == "whitted" and extended:
        raise NotReplayable(
            "sampler 'mitsuba': a tree of rays that samples lights with an area draws in "
            "the order of the tree; possible are path, direct, and whitted with point, "
            "spot and directional lights"
        )
    most = max(requested.emitter_samples, requested.bsdf_samples)
    if method == "direct" and most > MOST_SAMPLES:
        raise NotReplayable(
            f"sampler 'mitsuba': direct with {requested.emitter_samples} emitter_samples "
            f"and {requested.bsdf_samples} bsdf_samples cannot be replayed; possible are "
            f"up to {MOST_SAMPLES}, whose numbers are drawn ahead"
        )
    if requested.strategy != "both" or not requested.caustics:
        raise NotReplayable(
            "sampler 'mitsuba': Mitsuba has no integrator with one of the two ways to find "
            "light, or without caustics; possible is the scene without sampling=lights, "
            "sampling=bsdfs and caustics=off"
        )


# -------------------------------------------------------------------------- replay mode
# A replay of Mitsuba's numbers and rounding: other implementations of the interfaces.


class Planned(Protocol):
    """The attributes of a plan that a replay reads."""

    @property
    def method(self) -> str: ...  # noqa: D102
    @property
    def sampler(self) -> Sampler: ...  # noqa: D102
    @property
    def light_samples(self) -> int: ...  # noqa: D102
    @property
    def bsdf_samples(self) -> int: ...  # noqa: D102
    @property
    def kind(self) -> IntegratorKind: ...  # noqa: D102
    @property
    def trace(self) -> Any: ...  # noqa: D102
    @property
    def mis_densities(self) -> int: ...  # noqa: D102


class Replayed:
    """The variant for a replay; see `renderer.rendering.tables.render_mode.Variant`.

    Parameters
    ----------
    measured_camera
        See `replay.camera.replay_camera`.
    rules
        Of the Mitsuba version that is followed. A version that differs by more than numbers
        needs another class with the same interface.
    """

    previous_points = True
    in_order = True

    def __init__(
        self, measured_camera: Sequence[float] | None, rules: MitsubaRules = NEWEST
    ) -> None:
        self.arithmetic = AsMitsuba(rules.ray_epsilon)
        self._measured_camera = measured_camera

    def of_lights(self, media: bool) -> Any:
        """Return the common arithmetic, which starts from the last event's exact point."""
        return self.arithmetic

    def traced(
        self, scene: Scene, plan: Planned, record: Any, sampler: Any
    ) -> tuple[Any, Packed]:
        """Return the integrator's own loop, or the one for media in Mitsuba's order."""
        if not plan.kind.media:
            return plan.trace, pack(record)
        numbers, mis = sampler.numbers, plan.mis_densities
        carry = OfBothWays(numbers, int(mis == 1)) if mis else OfThroughput(numbers)
        order = in_order(record, sampler, scene.description, bool(mis), carry)
        return trace_in_order, pack(order)

    def instead(self, plan: Planned) -> Mapping[Any, Any]:
        """Return the replaced methods for `volpathmis`, whose weights need other stages."""
        return {0: {}, 1: INSTEAD_OF_ONE, 3: INSTEAD}[plan.mis_densities]

    def sampling(self, scene: Scene, plan: Planned, seed: int) -> Sampling:
        """Return Mitsuba's random numbers for a scene, by pixel of the full film."""
        camera = scene.description.camera
        shutter = 2 if kind_of_sensor(camera).has_aperture else 1
        film, beyond = camera.film, 2 * camera.film.border
        width, height = film.crop_width + beyond, film.crop_height + beyond
        seeds = np.zeros((film.height + beyond, film.width + beyond), np.uint32)
        down = slice(film.crop_offset_y, film.crop_offset_y + height)
        across = slice(film.crop_offset_x, film.crop_offset_x + width)
        seeds[down, across] = pixel_seeds(width, height, seed)
        shown = [sides(shape.bsdf) for shape in scene.description.every_shape]
        smooth = [
            any(side is not None and kind_of(side).smooth for side in both)
            for both in shown
        ]
        samples, media = max(plan.light_samples, plan.bsdf_samples), plan.kind.media
        rows = rows_of(samples)
        if media:
            rows = ROWS_OF_MIS if plan.mis_densities else ROWS_IN_MEDIA
        record = Replay(
            make_sequence(seeds.ravel(), plan.sampler),
            np.zeros((rows, seeds.size), "f4"),
            np.array(smooth or [False], np.int32),
            plan.light_samples,
            plan.bsdf_samples,
            int(plan.method == "direct"),
            shutter if camera.shutter_time > 0.0 else 0,
        )
        return Sampling(
            pack(record),
            draw_film,
            draw,
            choose_light,
            draw_aperture,
            begin_bounce=None if media else begin_bounce,
        )

    def surfaces(self, surfaces: dict[str, Any]) -> dict[str, Any]:
        """Return the surfaces, triangles with Mitsuba's normals and dp/du."""
        if "triangles" not in surfaces:
            return surfaces
        triangles = surfaces["triangles"]
        normals = face_normals(triangles.edge1, triangles.edge2)
        exact = replaced(triangles, normal=normals)
        exact = exact._replace(tangents=triangle_tangents(triangles))
        return surfaces | {"triangles": exact}

    def mesh_choice(self, count: int, surfaces: Any, tables: dict[int, Any]) -> Any:
        """Return the cumulative areas of mesh lights."""
        return triangle_shares(count, surfaces, tables)

    def lights(self, scene: Scene, lights: LightTables) -> LightTables:
        """Return the lights with Mitsuba's rounding, and its sphere around the scene."""
        description = scene.description
        skies = [sky for sky in description.emitters if isinstance(sky, EnvironmentMap)]
        order = light_order(description).of_emitters
        pairs = zip(order, description.emitters, strict=True)
        spots = {i: spot for i, spot in pairs if isinstance(spot, SpotLight)}

        around = sphere_around(scene.bounds, self.arithmetic.ray_epsilon)

        def rounded(table: Any) -> Any:
            if "around" in getattr(table, "_fields", ()):
                table = table._replace(around=around)
            if isinstance(table, EnvironmentMaps):
                return rounded_environment(table, skies[0])
            return rounded_spots(table, spots) if isinstance(table, SpotLights) else table

        tables = [rounded(table) for table in lights.tables]
        return dataclasses.replace(lights, tables=tables)

    def parameters(self, materials: MaterialTables) -> NDArray[np.float32]:
        """Return BSDF parameters with lobe probabilities from Mitsuba's texture means."""
        return rounded_shares(materials)

    def hooks(self, scene: Scene, surfaces: dict[str, Any]) -> list[tuple[Any, Any]]:
        """Return the hooks that round camera rays, surface points and scattered rays."""
        camera = replay_camera(scene.description.camera, self._measured_camera)
        return [
            (round_camera_rays, camera),
            (round_rays, Leaving()),
            *hooks_of_hits(scene.description, surfaces),
        ]
