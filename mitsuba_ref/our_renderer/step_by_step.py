"""Records one path through the kernels of a render, one stage at a time.

The stages of `follow_paths` are called from Python over a tile of one pixel; between them
the work arrays are read. The record is therefore what a render computes. The render's
kernels have no code for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer import single_stages as stages
from mitsuba_ref.our_renderer.light_names import light_names
from mitsuba_ref.our_renderer.numbers_drawn import NumbersDrawn
from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.traced_path import (
    BLACK,
    COLLISION,
    ENDED,
    WHITE,
    Bounce,
    SampledLight,
    Scattered,
    TracedPath,
    Vector,
    Weights,
)
from renderer.integrators.kind import NO_LIMIT
from renderer.kernels.jit import pack
from renderer.kernels.records.batch import Tile
from renderer.rendering.job import RenderJob

NAME = "lightproof"


class StepByStep:
    """Traces samples of single pixels of a render.

    Parameters
    ----------
    job
        By `direct` or `path`.
    """

    def __init__(self, job: RenderJob) -> None:
        self._job = job  # it keeps alive what the kernels' records point to
        self._record = record = job.kernel_scene
        self._film = job.scene.description.camera.film
        # The same code as the render's: only the depths at which roulette begins differ.
        certain = record.settings._replace(roulette_depth=NO_LIMIT, dim_depth=NO_LIMIT)
        self._scene = pack(record)
        self._without_roulette = pack(record._replace(settings=certain))
        self._light_names = light_names(job)
        self._work = job.make_workspace(channels=3)
        self._packed_work = pack(self._work)
        self._drawn = NumbersDrawn(job)
        self._begun = self._drawn  # as it is where the sample begins that is led
        self._most_bounces = int(record.settings.max_depth)

    def trace(self, pixel: tuple[int, int], sample: int) -> TracedPath:
        """Return one sample of the pixel (x, y) of the crop window."""
        tile = self._tile(pixel)
        for before in self._drawn.rewind(sample):
            self._trace(tile, before)
        return self._trace(tile, sample)

    def trace_led(
        self,
        pixel: tuple[int, int],
        sample: int,
        along: TracedPath,
        moves: Sequence[Moved | None] = (None,),
    ) -> Iterator[TracedPath]:
        """Yield the sample's path once for each move, led along another path.

        What a bounce makes of its ray is written down; then the next one starts with the
        other path's ray, density and throughput. So each step is that of our kernels on the
        very input that the other had, and no difference grows from one to the next.

        Parameters
        ----------
        pixel, sample
            As for `trace`.
        along
            The other path.
        moves
            Of one ray after it was led, the path ending with it; None: of no ray.

        Notes
        -----
        A replay's stream of numbers goes on from sample to sample; it is put back to where
        this one begins, since a moved path may draw more or fewer than the one before.
        """
        self.trace(pixel, sample - 1) if sample else self._drawn.rewind(0)
        self._begun = NumbersDrawn(self._job)
        for move in moves:
            self._begun.rewind(0)
            yield self._trace(self._tile(pixel), sample, move, along)

    def _tile(self, pixel: tuple[int, int]) -> Tile:
        film = self._film
        return Tile(
            film.crop_offset_x + pixel[0], film.crop_offset_y + pixel[1], 1, 1, film.width
        )

    def _move(self, moved: Moved | None, segment: int) -> None:
        """Move the ray in `work` if it is the one that is meant."""
        if moved is None or moved.segment != segment:
            return
        origin, direction = self._work.rays.origin, self._work.rays.direction
        new = direction[:, 0].astype(np.float64) + moved.by
        direction[:, 0] = new / np.linalg.norm(new)
        origin[:, 0] = origin[:, 0].astype(np.float64) + moved.start

    def _lead(
        self, tile: Tile, sample: int, along: TracedPath | None, segment: int
    ) -> None:
        """Make the ray in `work` that of another path, if that has one."""
        if along is None:
            return
        rays = self._work.rays
        if segment == 0:
            rays.origin[:, 0], rays.direction[:, 0] = along.origin, along.direction
            return
        before = along.bounces[segment - 1 : segment]
        on = before[0].scattered if before else None
        if on is None or on.origin is None:
            return
        rays.origin[:, 0], rays.direction[:, 0] = on.origin, on.direction
        if rays.pdf[0] > 0.0 and on.pdf > 0.0:
            rays.pdf[0] = on.pdf
        if rays.previous.shape[1] and before[0].position is not None:
            rays.previous[:, 0] = before[0].position

    def _trace(
        self,
        tile: Tile,
        sample: int,
        moved: Moved | None = None,
        along: TracedPath | None = None,
    ) -> TracedPath:
        work = self._work
        work.radiance[:] = 0.0
        count = stages.camera_ray_step(self._scene, tile, sample, self._packed_work, 0)
        origin, direction = column(work.rays.origin), column(work.rays.direction)
        self._lead(tile, sample, along, 0)
        self._move(moved, 0)
        last = NO_LIMIT
        if along is not None:  # a moved ray tells what becomes of it in one step alone
            last = len(along.bounces) if moved is None else moved.segment + 1
        drawn = self._drawn.of_film(tile)
        bounces: list[Bounce] = []
        self._first_hits(tile, sample, count)
        while count > 0 and len(bounces) < min(self._most_bounces, last):
            bounce = self._bounce(tile, sample, len(bounces), moved, along)
            bounces.append(bounce)
            count = int(bounce.scattered is not None and bounce.scattered.survived)
            if count:
                self._lead(tile, sample, along, len(bounces))
                self._move(moved, len(bounces))
                self._next_hits(count)
        return TracedPath(NAME, drawn, origin, direction, tuple(bounces))

    def _first_hits(self, tile: Tile, sample: int, count: int) -> None:
        """Intersect the camera rays."""
        if self._most_bounces > 0:
            stages.first_hit_step(self._scene, self._packed_work, 0, count)

    def _next_hits(self, count: int) -> None:
        """Intersect rays that were scattered."""
        stages.next_hit_step(self._scene, self._packed_work, count)

    def _bounce(
        self,
        tile: Tile,
        sample: int,
        bounce: int,
        moved: Moved | None,
        along: TracedPath | None,
    ) -> Bounce:
        """Follow the ray in `work` to where it arrives, and put the next one there."""
        work = self._work
        start, before = column(work.rays.origin), column(work.radiance)
        led = None if along is None else along.bounces[bounce]
        reached, collisions = self._fly(tile, sample, led)
        if reached + collisions == 0:
            return Bounce(radiance=before, event=ENDED)
        arriving = work.media.collisions if collisions else work.rays
        throughput, weights = column(arriving.throughput), self._weights(tile)
        hit = reached > 0 and int(work.hits.prim[0]) >= 0
        shape, face = self._what_was_hit() if hit else (0, None)
        # first: emitted light is weighed against the lights sampled at the previous point
        self._arrive(tile, bounce, reached)
        emitted = difference(column(work.radiance), before)
        if hit:
            stages.locate_step(self._scene, self._packed_work, 1)
        points = work.media.collisions if collisions else work.points
        position = column(points.position) if hit or collisions else None
        normal = column(points.shading_normal) if hit else None
        shaded = {}
        if hit or collisions:
            here = moved if moved is not None and moved.segment == bounce else None
            shaded = self._shade(tile, sample, bounce, collisions, here)
        return Bounce(
            shape=shape,
            face=face,
            t=math.inf if position is None else self._length(start, position),
            position=position,
            throughput=throughput,
            emitted=emitted,
            radiance=column(work.radiance),
            normal=normal,
            event=COLLISION if collisions else "",
            weights=weights,
            **shaded,
        )

    def _length(self, start: Vector, position: Vector) -> float:
        """Return the length of a segment that ends at a point."""
        return float(self._work.points.t[0])

    def _fly(self, tile: Tile, sample: int, led: Bounce | None) -> tuple[int, int]:
        """Return how many rays end at a surface or in the sky, and how many collide."""
        if led is not None:
            self._work.rays.throughput[:, 0] = led.throughput
        return 1, 0

    def _weights(self, tile: Tile) -> Weights:
        """Return what a path carries besides its throughput."""
        return {}

    def _arrive(self, tile: Tile, bounce: int, count: int) -> None:
        """Add the light of what `count` rays have hit."""
        stages.arrive_step(self._scene, np.int64(bounce), self._packed_work, count)

    def _shade(
        self, tile: Tile, sample: int, bounce: int, collisions: int, here: Moved | None
    ) -> dict[str, Any]:
        """Sample lights and the next direction at a point; return fields of its bounce."""
        scene, packed = self._scene, self._packed_work
        if bounce + 1 >= self._record.settings.max_depth:
            return {}
        stages.draw_step(scene, tile, sample, packed, 1)
        drawn = self._drawn.of_bounce(tile, int(self._work.hits.prim[0]))
        if here is not None and any(here.numbers):
            self._drawn.nudge(tile, here.numbers)
        stages.list_step(scene, packed, 1)
        smooth = stages.prepare_step(scene, packed)
        self._move_point(here)
        lights = self._sample_lights(tile, sample, np.int64(bounce), smooth)
        scattered = self._scatter(tile, sample, np.int64(bounce))
        left_out = smooth > 0 and not self._job.plan.follow
        fields = {"numbers": drawn, "lights": lights, "scattered": scattered}
        return fields | {"left_out": left_out}

    def _move_point(self, here: Moved | None, collisions: int = 0) -> None:
        """Move the point that is to be shaded."""
        if here is None:
            return
        points = self._work.media.collisions if collisions else self._work.points
        # a hit stands in the list of each kind of BSDF that its shape has
        place = points.position[:, : collisions or int(self._work.ends.max())]
        place[:] = place.astype(np.float64) + np.reshape(here.hit, (3, 1))

    def _what_was_hit(self) -> tuple[int, int | None]:
        """Return the shape's number in the file, and the face of a mesh."""
        record, hits = self._record, self._work.hits
        prim = int(hits.prim[0])
        triangles = self._job.scene.surfaces.get("triangles")
        number = int(record.shapes.number[record.primitives.shape[prim]])
        if record.placements.group.size and hits.instance[0] >= 0:
            number = int(record.placements.number[hits.instance[0]])
        on_mesh = triangles is not None and triangles.first <= prim < triangles.end
        return number, int(record.primitives.face[prim]) if on_mesh else None

    def _sample_lights(
        self, tile: Tile, sample: int, bounce: Any, count: int
    ) -> tuple[SampledLight, ...]:
        scene, packed = self._scene, self._packed_work
        if count == 0:
            return ()
        sampled = []
        for turn in range(stages.light_count(scene)):
            stages.light_step(scene, turn, tile, sample, bounce, packed, count)
            # From black, so that what a light adds tells whether it is seen: the rays'
            # own flags are overwritten, and small light can be lost in a sum.
            before = self._work.radiance[:, 0].copy()
            self._work.radiance[:, 0] = 0.0
            cast = stages.reflect_step(scene, packed)
            stages.visibility_step(scene, bounce, packed, cast)
            origin = column(self._work.shadow_rays.origin) if cast else None
            blocked = None if cast == 0 else not self._work.radiance[:, 0].any()
            self._work.radiance[:, 0] += before
            shown = np.flatnonzero(self._work.points.bsdf[:count] >= 0)
            if len(shown) > 0:
                sampled.append(self._sampled_light(int(shown[0]), blocked, origin))
        return tuple(sampled)

    def _sampled_light(
        self, i: int, blocked: bool | None, origin: Vector | None, passed: Vector = WHITE
    ) -> SampledLight:
        """Write down the light sampled at listed point i; None: no shadow ray was cast."""
        samples, shadow_rays = self._work.light_samples, self._work.shadow_rays
        light = int(samples.light[i])
        far = self._light_names[light].startswith("far ")
        # 1 if all lights were sampled, or if samples contain the probability
        every = self._record.settings.every_light or len(self._record.lights.choice)
        probability = np.float32(1.0 if every else 1.0 / self._record.lights.count)
        weight = samples.radiance[:, i : i + 1] * (np.float32(1.0) / probability)
        return SampledLight(
            light=self._light_names[light].removeprefix("far "),
            direction=column(samples.wi[:, i:]),
            distance=math.inf if far else float(samples.distance[i]),
            pdf=float(samples.pdf[i] * probability),
            weight=column(weight),
            carried=BLACK if blocked is None else column(shadow_rays.radiance),
            blocked=blocked,
            origin=origin,
            passed=passed,
        )

    def _scatter(self, tile: Tile, sample: int, bounce: Any) -> Scattered | None:
        """Scatter without roulette, to see what it decides about, then with it."""
        work, packed = self._work, self._packed_work
        certain = self._without_roulette
        if stages.scatter_step(certain, tile, sample, bounce, packed) == 0:
            return None
        direction, throughput = column(work.rays.direction), column(work.rays.throughput)
        pdf = max(float(work.rays.pdf[0]), 0.0)
        origin = column(work.rays.origin)
        going_on = stages.scatter_step(self._scene, tile, sample, bounce, packed)
        return Scattered(direction, pdf, throughput, going_on > 0, origin)


def column(rows: NDArray[np.float32]) -> Vector:
    """Return column 0 of three rows or more."""
    return float(rows[0, 0]), float(rows[1, 0]), float(rows[2, 0])


def difference(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
