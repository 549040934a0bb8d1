"""What each stage of path tracing takes: its stages one by one, by the clock."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer import single_stages as stages
from renderer.kernels.jit import compiled_for, pack
from renderer.kernels.records.batch import Tile
from renderer.rendering.job import RenderJob, filter_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene

CAMERA, FIRST, NEXT = "camera rays", "hits of camera rays", "hits after a bounce"
EMISSION, SURFACES = "light that is hit", "surface points"
PARAMETERS, LIGHTS = "parameters and textures", "choice and samples of lights"
REFLECTION, VISIBILITY = "BSDFs towards lights", "shadow rays"
SCATTERING, FILM = "samples of BSDFs", "film"
STAGES = (
    CAMERA,
    FIRST,
    NEXT,
    EMISSION,
    SURFACES,
    PARAMETERS,
    LIGHTS,
    REFLECTION,
    VISIBILITY,
    SCATTERING,
    FILM,
)


class StageTimes(NamedTuple):
    """Seconds of each stage, and how many rays took part."""

    seconds: dict[str, float]
    rays: dict[str, int]
    by_bounce: list[tuple[float, int, int]]  # seconds, rays, batches
    sums: NDArray[np.float64]  # of the film, by which a test sees that it is the render's


class _Clock:
    """Calls entry kernels, and adds up their times."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.rays: Counter[str] = Counter()
        self._ready: dict[Any, Callable[..., Any]] = {}

    def __call__(self, stage: str, rays: int, kernel: Any, *arguments: Any) -> Any:
        ready = self._ready.get(kernel)
        if ready is None:
            kernel(*arguments)
            ready = self._ready[kernel] = compiled_for(kernel, *arguments)
        start = time.perf_counter()
        found = ready(*arguments)
        self.seconds[stage] += time.perf_counter() - start
        self.rays[stage] += rays
        return found


def stage_times(scene: Scene, spp: int, *, every: int = 1, **options: Any) -> StageTimes:
    """Render a picture with `path` stage by stage, on one thread.

    Panes block light samples here, as with `light_choice="uniform"`.

    Parameters
    ----------
    scene
        The scene.
    spp
        Samples per pixel.
    every
        Of so many tiles one is rendered.
    **options
        Further options of the plan.
    """
    plan = replace(make_plan(scene, spp=spp, **options), through_panes=False)
    if plan.name != "path":
        raise ValueError(f"the method is {plan.name}; its stages are those of path tracing")
    job = RenderJob(scene, plan, RenderOptions(threads=1))
    film = job.make_film()
    record, rfilter = pack(job.kernel_scene), filter_of(scene, plan)
    work = job.make_workspace(job.shape.channels)
    packed = pack(work)
    level, together = job.level, plan.squares(job.level)
    clock = _Clock()
    for attempt in range(2):  # the first compiles
        clock.seconds.clear()
        clock.rays.clear()
        by_bounce = [[0.0, 0, 0] for _ in range(64)]
        film.sums[:] = 0.0
        for number in range(0, len(film.tiles), every if attempt else len(film.tiles)):
            x, y, width, height, across = film.tiles[number].tolist()
            for sample in range(0, spp, 1 << 2 * level):
                tile = Tile(x, y, width, height, across, level)
                clock(FILM, 0, stages.clear_step, tile, packed)
                for square in range(0, 1 << 2 * level, together):
                    batch = Tile(x, y, width, height, across, level, square, together)
                    _trace(clock, job, record, packed, work, batch, sample, by_bounce)
                sums = film.sums[number]
                arguments = pack(rfilter), tile, packed, sums, job.shape.border
                clock(FILM, 0, stages.film_step, *arguments)
    reached = [(row[0], int(row[1]), int(row[2])) for row in by_bounce if row[1]]
    return StageTimes(dict(clock.seconds), dict(clock.rays), reached, film.sums)


def _trace(
    clock: _Clock,
    job: RenderJob,
    scene: Any,
    packed: Any,
    work: Any,
    tile: Tile,
    sample: int,
    by_bounce: list[list[float]],
) -> None:
    """Do as `follow_paths`."""
    settings = job.kernel_scene.settings
    count = 0
    for number in range(tile.square, tile.square + tile.squares):
        square = tile._replace(square=number, squares=1)
        if not stages.places_step(square):
            continue
        first = count
        count = clock(
            CAMERA, 1024, stages.camera_ray_step, scene, square, sample, packed, first
        )
        n = count - first
        clock(FIRST, n, stages.first_hit_step, scene, packed, first, n)
    for bounce in range(settings.max_depth):
        if count == 0:
            return
        begin = sum(clock.seconds.values())
        row = by_bounce[min(bounce, 63)]
        row[1] += count
        row[2] += 1
        depth = np.int64(bounce)
        clock(EMISSION, count, stages.arrive_step, scene, depth, packed, count)
        if bounce + 1 >= settings.max_depth:
            row[0] += sum(clock.seconds.values()) - begin
            return
        clock(SURFACES, count, stages.list_step, scene, packed, count)
        smooth = clock(PARAMETERS, count, stages.prepare_step, scene, packed)
        if smooth:
            for turn in range(stages.light_count(scene)):
                given = tile, sample, depth, packed, smooth
                clock(LIGHTS, smooth, stages.light_step, scene, turn, *given)
                cast = clock(REFLECTION, smooth, stages.reflect_step, scene, packed)
                shadow = scene, depth, packed, cast
                clock(VISIBILITY, cast, stages.visibility_step, *shadow)
        arguments = scene, tile, sample, depth, packed
        count = clock(SCATTERING, count, stages.scatter_step, *arguments)
        if count:
            clock(NEXT, count, stages.next_hit_step, scene, packed, count)
        row[0] += sum(clock.seconds.values()) - begin
