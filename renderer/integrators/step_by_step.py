"""One path through the kernels of a render, one stage at a time, written down.

The stages of `trace_paths` are called from Python over a tile of one pixel; between them
the work arrays are read. What is written down is therefore what a render computes; the
render's own kernels know nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.batch import CAPACITY, Workspace, make_workspace
from renderer.integrators import single_stages as stages
from renderer.kernel_scene import CONSTANT, DIRECTIONAL
from renderer.plan import NO_LIMIT
from renderer.rendering import Rendering
from renderer.replay.numbers_drawn import NumbersDrawn
from renderer.stages.tile import Tile
from renderer.traced_path import (
    BLACK,
    Bounce,
    LightAsked,
    Numbers,
    Scattered,
    TracedPath,
    Vector,
)

NAME = "lightproof"


@dataclass(frozen=True)
class Moved:
    """A small change of one of a path's rays, to see what depends on it."""

    segment: int  # 0: the camera ray
    by: Vector  # added to the ray's unit direction: of the ray's length


class StepByStep:
    """Traces samples of single pixels of a render.

    Parameters
    ----------
    rendering
        By `direct` or `path`.
    """

    def __init__(self, rendering: Rendering) -> None:
        self._scene = scene = rendering.kernel_scene
        self._film = rendering.scene.description.camera.film
        settings = scene.settings
        # The same code as the render's: only the depth at which roulette begins differs.
        certain = settings._replace(
            roulette_depth=None if settings.roulette_depth is None else NO_LIMIT
        )
        self._without_roulette = scene._replace(settings=certain)
        self._light_names = _light_names(rendering)
        self._work: Workspace = make_workspace(
            ray_capacity=CAPACITY,
            shadow_capacity=CAPACITY,
            channels=3,
            depths=1,
            instances=scene.accelerators.instances is not None,
            replay=rendering.plan.replay,
        )
        self._answer = np.zeros((stages.ASKED_ROWS, 64), np.float32)
        self._drawn = NumbersDrawn(scene)

    def trace(self, pixel: tuple[int, int], sample: int) -> TracedPath:
        """Return one sample of the pixel (x, y) of the crop window."""
        tile = self._tile(pixel)
        for before in self._drawn.rewind(sample):
            self._trace(tile, before)
        return self._trace(tile, sample)

    def trace_moved(
        self, pixel: tuple[int, int], sample: int, moves: Sequence[Moved]
    ) -> Iterator[TracedPath]:
        """Yield the sample's path once for each move, with one ray moved by it.

        A replay's stream of numbers goes on from sample to sample; it is put back to where
        this one begins, since a moved path may draw more or fewer than the one before.
        """
        self.trace(pixel, sample - 1) if sample else self._drawn.rewind(0)
        here = NumbersDrawn(self._scene)
        for move in moves:
            here.rewind(0)
            yield self._trace(self._tile(pixel), sample, move)

    def _tile(self, pixel: tuple[int, int]) -> Tile:
        film = self._film
        return Tile(
            film.crop_offset_x + pixel[0], film.crop_offset_y + pixel[1], 1, 1, film.width
        )

    def _move(self, moved: Moved | None, segment: int) -> None:
        """Move the ray in `work` if it is the one that is meant."""
        if moved is None or moved.segment != segment:
            return
        direction = self._work.rays.direction
        new = direction[:, 0].astype(np.float64) + moved.by
        direction[:, 0] = new / np.linalg.norm(new)

    def _trace(self, tile: Tile, sample: int, moved: Moved | None = None) -> TracedPath:
        scene, work = self._scene, self._work
        work.radiance[:] = 0.0
        count = stages.camera_ray_step(scene, tile, sample, work)
        self._move(moved, 0)
        origin, direction = _column(work.rays.origin), _column(work.rays.direction)
        drawn = self._drawn.of_film(tile)
        bounces: list[Bounce] = []
        if scene.settings.max_depth > 0:
            stages.first_hit_step(scene, work, count)
        while count > 0 and len(bounces) < scene.settings.max_depth:
            bounce = self._bounce(tile, sample, np.int64(len(bounces)))
            bounces.append(bounce)
            count = int(bounce.scattered is not None and bounce.scattered.survived)
            if count:
                self._move(moved, len(bounces))
                stages.next_hit_step(scene, work, count)
        return TracedPath(NAME, drawn, origin, direction, tuple(bounces))

    def _bounce(self, tile: Tile, sample: int, bounce: Any) -> Bounce:
        """Follow the ray in `work` to where it arrives, and put the next one there."""
        scene, work = self._scene, self._work
        throughput, before = _column(work.rays.throughput), _column(work.radiance)
        hit = int(work.hits.prim[0]) >= 0
        shape, face = self._what_was_hit() if hit else (0, None)
        stages.locate_step(scene, work, 1)
        position = _column(work.points.position) if hit else None
        normal = _column(work.points.shading_normal) if hit else None
        t = float(work.points.t[0]) if hit else math.inf
        stages.arrive_step(scene, bounce, work, 1)
        emitted = _difference(_column(work.radiance), before)
        lights: tuple[LightAsked, ...] = ()
        scattered = None
        drawn: Numbers = {}
        left_out = False
        if hit and bounce + 1 < scene.settings.max_depth:
            stages.draw_step(scene, tile, sample, work, 1)
            drawn = self._drawn.of_bounce(tile, int(work.hits.prim[0]))
            groups = stages.group_step(scene, work, 1)
            lights = self._ask_lights(tile, sample, bounce, groups[0])
            scattered = self._scatter(tile, sample, bounce, groups)
            left_out = groups[0] > 0 and scene.settings.follow is None
        return Bounce(
            shape=shape,
            face=face,
            t=t,
            position=position,
            throughput=throughput,
            emitted=emitted,
            numbers=drawn,
            lights=lights,
            scattered=scattered,
            left_out=left_out,
            radiance=_column(work.radiance),
            normal=normal,
        )

    def _what_was_hit(self) -> tuple[int, int | None]:
        """Return the shape's number in the file, and the face of a mesh."""
        scene, hits = self._scene, self._work.hits
        prim = int(hits.prim[0])
        instances, triangles = scene.accelerators.instances, scene.surfaces.triangles
        number = int(scene.shapes.number[scene.shape[prim]])
        if instances is not None and hits.instance[0] >= 0:
            number = int(instances.placements.number[hits.instance[0]])
        on_mesh = triangles is not None and triangles.first <= prim < triangles.end
        return number, int(scene.face[prim]) if on_mesh else None

    def _ask_lights(
        self, tile: Tile, sample: int, bounce: Any, stop: int
    ) -> tuple[LightAsked, ...]:
        scene, work, lights = self._scene, self._work, self._scene.lights
        if stop == 0 or lights is None:
            return ()
        asked = []
        for turn in range(stages.light_count(lights, scene.settings)):
            answer = self._answer
            stages.ask_light(scene, lights, turn, tile, sample, bounce, work.points, answer)
            cast = stages.shadow_ray_step(
                scene, lights, turn, tile, sample, bounce, work, stop
            )
            if answer[stages.SEEN, 0]:
                asked.append(self._light_asked(cast > 0))
        return tuple(asked)

    def _light_asked(self, cast: bool) -> LightAsked:
        answer, shadow_rays = self._answer, self._work.shadow_rays
        light = int(answer[stages.LIGHT, 0])
        far = self._scene.lights.kind[light] in (CONSTANT, DIRECTIONAL)
        return LightAsked(
            light=self._light_names[light],
            direction=_column(answer[stages.WI : stages.WI + 3]),
            distance=math.inf if far else float(answer[stages.DISTANCE, 0]),
            pdf=float(answer[stages.PDF, 0]),
            weight=_column(answer[stages.RADIANCE : stages.RADIANCE + 3]),
            carried=_column(shadow_rays.radiance) if cast else BLACK,
            blocked=bool(shadow_rays.blocked[0]) if cast else None,
        )

    def _scatter(
        self, tile: Tile, sample: int, bounce: Any, groups: Any
    ) -> Scattered | None:
        """Scatter without roulette, to see what it decides about, then with it."""
        work = self._work
        certain = self._without_roulette
        if stages.scatter_step(certain, tile, sample, bounce, work, groups) == 0:
            return None
        direction, throughput = _column(work.rays.direction), _column(work.rays.throughput)
        pdf = float(work.rays.pdf[0])
        going_on = stages.scatter_step(self._scene, tile, sample, bounce, work, groups)
        return Scattered(direction, pdf, throughput, going_on > 0)


def _light_names(rendering: Rendering) -> list[str]:
    """Name lights, by light id, as `LightAsked.light` says."""
    scene = rendering.kernel_scene
    count = scene.lights.count if scene.lights is not None else 0
    names = [""] * count
    for shape, light in enumerate(scene.shapes.light):
        if light >= 0:
            names[light] = f"shape {scene.shapes.number[shape]}"
    others = (light for light in range(count) if not names[light])
    for number, light in enumerate(others, start=1):
        names[light] = f"emitter {number}"
    return names


def _column(rows: NDArray[np.float32]) -> Vector:
    """Return column 0 of three rows."""
    return float(rows[0, 0]), float(rows[1, 0]), float(rows[2, 0])


def _difference(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
