"""Records one path of a replay of `volpath` or `volpathmis`, one stage at a time.

A bounce is a flight with all of its null collisions, and what happens where it ends: at a
surface, or at a collision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer import media_stages, single_stages
from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.step_by_step import StepByStep, column
from mitsuba_ref.our_renderer.traced_path import (
    DENSITIES,
    LIT,
    LIT_DENSITIES,
    Bounce,
    Numbers,
    SampledLight,
    Scattered,
    TracedPath,
    Vector,
    Weights,
)
from renderer.integrators.kind import NO_LIMIT
from renderer.kernels.records.batch import Tile
from renderer.plugins.bsdfs.kind import STRAIGHT
from renderer.rendering.job import RenderJob
from renderer.replay.media.record import PASSED
from renderer.replay.media.spectral_mis import PATH, SHADOW
from renderer.replay.sequences import BSDF, BSDF_CHOICE, LIGHT

_OF_LIGHTS = slice(LIGHT, LIGHT + 2)  # rows of the numbers of a replay
_OF_DIRECTIONS = slice(BSDF_CHOICE, BSDF + 2)


class StepsInMedia(StepByStep):
    """Traces samples of single pixels of a replay.

    Parameters
    ----------
    job
        By `volpath` or `volpathmis`, with Mitsuba's numbers.
    """

    def __init__(self, job: RenderJob) -> None:
        super().__init__(job)
        record, sampler = job.kernel_scene, job.sampler.record
        _, self._order = job.variant.traced(job.scene, job.plan, record, sampler)
        self._numbers = sampler.numbers
        self._both_ways = job.plan.mis_densities > 0
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
        self._lead_weights(tile, scattered)
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

    def _weights_at(self, tile: Tile) -> NDArray[np.float32]:
        """Return a view on what `volpathmis` carries for a pixel, a row of RGB for each."""
        rows = self._numbers[PATH:SHADOW, tile.y * tile.film_width + tile.x]
        return rows.reshape(3, 3)

    def _weights(self, tile: Tile) -> Weights:
        """Return what a path of `volpathmis` carries; see `note_scattered`."""
        if not self._both_ways:
            return {}
        carried, pdf = self._weights_at(tile), self._work.rays.pdf[0]
        weights = {DENSITIES: carried[0]}
        if pdf > 0.0:
            weights |= {LIT: carried[1] / pdf, LIT_DENSITIES: carried[2]}
        return {name: column(weight[:, None]) for name, weight in weights.items()}

    def _lead_weights(self, tile: Tile, scattered: Scattered) -> None:
        if not self._both_ways:
            return
        carried, weights = self._weights_at(tile), scattered.weights
        for row, name in enumerate((DENSITIES, LIT, LIT_DENSITIES)):
            carried[row] = weights.get(name, carried[row])
        if LIT in weights:
            carried[1] *= scattered.pdf

    def _length(self, start: Vector, position: Vector) -> float:
        """Return the length of a segment, of all flights in it."""
        return math.dist(start, position)

    def _fly(self, tile: Tile, sample: int, led: Bounce | None) -> tuple[int, int]:
        self._drawn.forget(tile)
        ended = media_stages.fly_step(self._order, tile, sample, self._packed_work)
        return int(ended & 1), int(ended >> 1)

    def _arrive(self, tile: Tile, bounce: int, count: int) -> None:
        media_stages.arrive_step(self._order, tile, self._packed_work, np.int64(count))

    def _shade(
        self, tile: Tile, sample: int, bounce: int, collisions: int, here: Moved | None
    ) -> dict[str, Any]:
        order, packed, hits = self._order, self._packed_work, np.int64(not collisions)
        there = np.int64(collisions)
        media_stages.draw_lights_step(order, tile, sample, packed, hits, there)
        drawn = self._drawn.of_event(tile, bool(collisions))
        self._move_point(here, collisions)
        if here is not None:
            self._drawn.nudge(tile, here.numbers, _OF_LIGHTS)
        lights = self._light(tile, sample, collisions, drawn)
        media_stages.draw_directions_step(order, tile, sample, packed, hits, there)
        drawn = self._drawn.of_event(tile, bool(collisions)) | drawn
        if here is not None:
            self._drawn.nudge(tile, here.numbers, _OF_DIRECTIONS)
        scattered = self._scattered(tile, sample, there)
        return {"numbers": drawn, "lights": lights, "scattered": scattered}

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
        carried = column(work.shadow_rays.radiance)
        passed = column(self._numbers[PASSED:, tile.y * tile.film_width + tile.x :])
        if self._both_ways:  # weights follow once it is known what both techniques pass
            passed = ratio(column(work.radiance), carried)
        work.radiance[:, 0] += before
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
        origin, weights = column(rays.origin), self._weights(tile)
        return Scattered(direction, pdf, throughput, True, origin, straight, weights)


def ratio(a: Vector, b: Vector) -> Vector:
    """Return a / b of each component, and 0 where b is 0."""
    x, y, z = (p / q if q else 0.0 for p, q in zip(a, b, strict=True))
    return x, y, z


def _kinds_of(names: list[str]) -> Iterator[int]:
    """Yield how each number was drawn, by the names that `NumbersDrawn` gives it."""
    for name in names:
        if name.endswith(" x"):
            yield media_stages.TWO
        elif not name.endswith(" y"):
            yield media_stages.SKIPPED if name.startswith("skipped") else media_stages.ONE
