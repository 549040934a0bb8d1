"""Records one path of a replay of `volpath`, one stage at a time.

A bounce is a flight with all of its null collisions, and what happens where it ends: at a
surface, or at a collision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mitsuba_ref.our_renderer import media_stages, single_stages
from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.step_by_step import StepByStep, column, difference
from mitsuba_ref.our_renderer.traced_path import (
    BLACK,
    COLLISION,
    ENDED,
    Bounce,
    Numbers,
    SampledLight,
    Scattered,
    TracedPath,
)
from renderer.integrators.kind import NO_LIMIT
from renderer.kernels.records.batch import Tile
from renderer.plugins.bsdfs.kind import STRAIGHT
from renderer.rendering.job import RenderJob
from renderer.replay.media.record import PASSED
from renderer.replay.sequences import BSDF, BSDF_CHOICE, LIGHT

_OF_LIGHTS = slice(LIGHT, LIGHT + 2)  # rows of the numbers of a replay
_OF_DIRECTIONS = slice(BSDF_CHOICE, BSDF + 2)


class StepsInMedia(StepByStep):
    """Traces samples of single pixels of a replay.

    Parameters
    ----------
    job
        By `volpath`, with Mitsuba's numbers.
    """

    def __init__(self, job: RenderJob) -> None:
        super().__init__(job)
        record, sampler = job.kernel_scene, job.sampler.record
        _, self._order = job.variant.traced(job.scene, job.plan, record, sampler)
        self._numbers = sampler.numbers
        self._most_bounces = NO_LIMIT  # surfaces that let a path through do not count

    def _first_hits(self, tile: Tile, sample: int, count: int) -> None:
        single_stages.first_hit_step(self._scene, self._packed_work, 0, count)
        media_stages.begin_step(self._order, tile, sample, self._packed_work, count)

    def _next_hits(self, count: int) -> None:
        media_stages.next_hits_step(self._order, self._packed_work, count)

    def _lead(
        self, tile: Tile, sample: int, along: TracedPath | None, segment: int
    ) -> None:
        """Make the ray in `work` that of another path, and its random numbers.

        The other one may have drawn more or fewer of them in a medium.
        """
        super()._lead(tile, sample, along, segment)
        if along is None or segment == 0:
            return
        rays, before = self._work.rays, along.bounces[:segment]
        scattered = before[-1].scattered
        if len(before) < segment or scattered is None:
            return
        rays.throughput[:, 0] = scattered.throughput
        last = [b for b in before if b.scattered is not None and not b.scattered.straight]
        at = last[-1].position if last else along.origin
        assert at is not None
        rays.previous[:, 0] = at
        self._begun.rewind(0)
        numbers = (along.numbers, *(b.numbers for b in before))
        drawn = [name for numbers_of_one in numbers for name in numbers_of_one]
        kinds = np.array(list(_kinds_of(drawn)), np.int64)
        pixel = np.int64(tile.y * tile.film_width + tile.x)
        media_stages.redraw_step(self._order, pixel, sample, kinds)

    def _bounce(
        self,
        tile: Tile,
        sample: int,
        bounce: int,
        moved: Moved | None,
        along: TracedPath | None,
    ) -> Bounce:
        order, work, packed = self._order, self._work, self._packed_work
        start, before = column(work.rays.origin), column(work.radiance)
        self._drawn.forget(tile)
        ended = media_stages.fly_step(order, tile, sample, packed)
        reached, collisions = np.int64(ended & 1), np.int64(ended >> 1)
        if not ended:
            return _end_of_path(before)
        hit = bool(reached) and int(work.hits.prim[0]) >= 0
        shape, face = self._what_was_hit() if hit else (0, None)
        media_stages.arrive_step(order, tile, packed, reached)
        if hit:
            single_stages.locate_step(self._scene, packed, 1)
        points = work.media.collisions if collisions else work.points
        position = column(points.position) if hit or collisions else None
        normal = column(points.shading_normal) if hit else None
        throughput = column(points.throughput if collisions else work.rays.throughput)
        emitted = difference(column(work.radiance), before)
        media_stages.draw_lights_step(order, tile, sample, packed, reached, collisions)
        drawn = self._drawn.of_event(tile, bool(collisions))
        here = moved if moved is not None and moved.segment == bounce else None
        if here is not None:
            # a hit stands in the list of each kind of BSDF that its shape has
            place = points.position[:, : 1 if collisions else int(work.ends.max())]
            place[:] = place.astype(np.float64) + np.reshape(here.hit, (3, 1))
            self._drawn.nudge(tile, here.numbers, _OF_LIGHTS)
        lights = self._light(tile, sample, int(collisions), drawn)
        media_stages.draw_directions_step(order, tile, sample, packed, reached, collisions)
        drawn = self._drawn.of_event(tile, bool(collisions)) | drawn
        if here is not None:
            self._drawn.nudge(tile, here.numbers, _OF_DIRECTIONS)
        return Bounce(
            shape=shape,
            face=face,
            t=math.inf if position is None else math.dist(start, position),
            position=position,
            throughput=throughput,
            emitted=emitted,
            numbers=drawn,
            lights=lights,
            scattered=self._scattered(tile, sample, collisions),
            radiance=column(work.radiance),
            normal=normal,
            event=COLLISION if collisions else "",
        )

    def _light(
        self, tile: Tile, sample: int, collisions: int, drawn: Numbers
    ) -> tuple[SampledLight, ...]:
        """Sample a light where numbers were drawn for one."""
        work = self._work
        if not drawn:
            return ()
        before = work.radiance[:, 0].copy()
        work.radiance[:, 0] = 0.0
        work.shadow_rays.radiance[:, 0] = 0.0  # it stays if no light is reflected
        packed = self._packed_work
        media_stages.light_step(self._order, tile, sample, packed, np.int64(collisions))
        work.radiance[:, 0] += before
        passed = column(self._numbers[PASSED:, tile.y * tile.film_width + tile.x :])
        carried = column(work.shadow_rays.radiance)
        blocked = not any(passed) if any(carried) else None
        count = 1 if collisions else int(work.ends[self._record.bsdfs.smooth])
        points = work.media.collisions if collisions else work.points
        shown = np.flatnonzero(points.bsdf[:count] >= 0)
        if len(shown) == 0 or len(self._light_names) == 0:
            return ()
        return (self._sampled_light(int(shown[0]), blocked, None, passed),)

    def _scattered(self, tile: Tile, sample: int, collisions: np.int64) -> Scattered | None:
        """Scatter; roulette is played in the flight."""
        packed, rays = self._packed_work, self._work.rays
        if media_stages.scatter_step(self._order, tile, sample, packed, collisions) == 0:
            return None
        direction, throughput = column(rays.direction), column(rays.throughput)
        pdf, straight = max(float(rays.pdf[0]), 0.0), int(rays.lobe[0]) == STRAIGHT
        return Scattered(direction, pdf, throughput, True, column(rays.origin), straight)


def _end_of_path(radiance: tuple[float, float, float]) -> Bounce:
    """Return the bounce of a flight that ends nowhere."""
    return Bounce(0, None, 0.0, None, BLACK, BLACK, {}, (), None, radiance, event=ENDED)


def _kinds_of(names: list[str]) -> Iterator[int]:
    """Yield how each number was drawn, by the names that `NumbersDrawn` gives it."""
    for name in names:
        if name.endswith(" x"):
            yield media_stages.TWO
        elif not name.endswith(" y"):
            yield media_stages.SKIPPED if name.startswith("skipped") else media_stages.ONE
