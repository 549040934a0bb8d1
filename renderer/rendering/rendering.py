"""One render under way: tiles over a thread pool; an interrupt keeps the picture so far."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from renderer.integrators.direct import KEPT
from renderer.integrators.moment import squared_sums
from renderer.integrators.whitted import REGION
from renderer.jit import Packed, pack
from renderer.records.batch import CAPACITY, Workspace, make_workspace
from renderer.records.kernel_scene import KernelScene
from renderer.records.tile import Tile
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.variant import way_of
from renderer.scene.scene import Scene
from renderer.stages.film import BOX, Film, filter_border, filter_table, tile_sums

# One job of a thread: so many samples of a tile that it takes some 10 ms.
SAMPLES_PER_JOB = 16


@dataclass(frozen=True)
class Progress:
    """Where a render is: handed to the `progress` callback.

    There is no stage "compile" when all kernels are in the cache. The callback may raise
    KeyboardInterrupt, which ends the render as Ctrl-C does.
    """

    stage: str  # "compile", done 0 and then 1 of 1, then "render"
    done: int  # samples so far
    total: int
    seconds: float  # in this stage


@dataclass(frozen=True)
class _Job:
    tile: Tile
    first_sample: int
    end_sample: int


class _Workspaces(threading.local):
    """One workspace for each thread of the pool."""

    def __init__(self, make: Callable[[], Packed]) -> None:
        self.make = make
        self.work: Packed | None = None

    def get(self) -> Packed:
        if self.work is None:
            self.work = self.make()
        return self.work


class Rendering:
    """One render: everything prepared, then `run`.

    Parameters are those of `render`, with the `plan` made and every choice named.
    """

    def __init__(
        self,
        scene: Scene,
        plan: Plan,
        *,
        accel: str,
        seed: int,
        threads: int,
        measured_camera: Sequence[float] | None = None,
    ) -> None:
        self.scene, self.plan, self.threads = scene, plan, threads
        self.variant = way_of(plan, measured_camera)
        # keeps alive what the addresses in the record point to
        self._inputs = KernelInputs(scene, plan, accel, seed, self.variant)
        self.kernel_scene = self._inputs.record
        kind = plan.kind
        self._render_tile = kind.render_several if plan.several else kind.render
        self.channels = kind.channels
        film = scene.description.camera.film
        # counts stay in their own pixel, so that they can be added up
        self.counted = kind.counts_work
        self.rfilter = BOX if self.counted else filter_table(film.rfilter)
        if plan.moments is not None:
            squares = squared_sums(kind, scene.description.integrator)
            self.rfilter = self.rfilter._replace(squares=squares)
            self.channels += len(squares)
        self._packed_filter = pack(self.rfilter)
        self.border = filter_border(self.rfilter)
        self.film = Film(
            self.channels,
            film.crop_offset_x + film.border,
            film.crop_offset_y + film.border,
            film.crop_width,
            film.crop_height,
            self.border,
        )
        beyond = 2 * film.border
        self._tiles = self.film.tiles(film.width + beyond, film.border)
        self.seed = seed
        self.samples_done = 0
        pixels = (film.crop_width + beyond) * (film.crop_height + beyond)
        self.samples_in_all = pixels * plan.spp
        self._workspaces = _Workspaces(lambda: pack(self.make_workspace(self.channels)))
        self._before: dict[Tile, Future[Any]] = {}  # of a replay: the last job of each tile

    @property
    def kernel_scene(self) -> KernelScene:
        """What the kernels may look at; another one may be put in its place."""
        return self._record

    @kernel_scene.setter
    def kernel_scene(self, record: KernelScene) -> None:
        self._record, self._packed_scene = record, pack(record)

    @property
    def sampler(self) -> Packed:
        """The sampler's record, as kernels see it."""
        return self._inputs.sampler

    def make_workspace(self, channels: int) -> Workspace:
        """Allocate what one thread works in."""
        depths, capacity = 1, CAPACITY
        if self.plan.kind.splits:
            depths = self.plan.max_depth + 1
            capacity = REGION * depths
        elif self.plan.several:
            capacity = KEPT + CAPACITY
        bsdfs = self.kernel_scene.bsdfs
        return make_workspace(
            ray_capacity=capacity,
            channels=channels,
            depths=depths,
            kinds=len(bsdfs.methods),
            parameters=len(bsdfs.values),
            counted=self.counted,
            previous_points=self.variant.previous_points,
        )

    def _render(self, job: _Job) -> Any:
        sums = tile_sums(self.channels, self.border)
        self._render_tile(
            self._packed_scene,
            self._packed_filter,
            job.tile,
            job.first_sample,
            job.end_sample,
            self._workspaces.get(),
            sums,
            self.border,
        )
        return sums

    @property
    def methods_seconds(self) -> float:
        """The part of the preparation in which kernels were compiled or loaded."""
        return self._inputs.compile_seconds

    def compile(self) -> float:
        """Compile what calls the methods, or load it; return the seconds it took."""
        start = time.perf_counter()
        self._render(_Job(self._tiles[0], 0, 0))
        return time.perf_counter() - start

    def _jobs(self) -> Iterator[_Job]:
        asked = max(1, self.kernel_scene.lights.count) if self.plan.every_light else 1
        step = max(1, SAMPLES_PER_JOB // asked)
        for first in range(0, self.plan.spp, step):
            for tile in self._tiles:
                yield _Job(tile, first, min(first + step, self.plan.spp))

    def run(self, progress: Callable[[Progress], None] | None = None) -> bool:
        """Trace all samples; return whether it went to the end.

        Tiles are added to the film in a fixed order whatever order they are done in. An
        interrupt (Ctrl-C) ends the render after the jobs that are under way; one more
        while these end is raised.
        """
        waiting: deque[tuple[_Job, Future[Any]]] = deque()
        pool = ThreadPoolExecutor(self.threads)
        try:
            self._trace(pool, waiting, progress)
            return True
        except (KeyboardInterrupt, RuntimeError) as error:
            # Ctrl-C may strike while Python's own wait has let go of a lock; leaving it
            # then raises a RuntimeError, which hides the interrupt
            interrupt = error.__context__ if isinstance(error, RuntimeError) else error
            if not isinstance(interrupt, KeyboardInterrupt):
                raise
            under_way = [(job, future) for job, future in waiting if not future.cancel()]
            for job, future in under_way:
                self._finish(job, future.result())
            return False
        finally:
            pool.shutdown(cancel_futures=True)

    def _trace(
        self,
        pool: ThreadPoolExecutor,
        waiting: deque[tuple[_Job, Future[Any]]],
        progress: Callable[[Progress], None] | None,
    ) -> None:
        start = time.perf_counter()
        jobs = self._jobs()
        while True:
            if progress is not None:
                seconds = time.perf_counter() - start
                progress(
                    Progress("render", self.samples_done, self.samples_in_all, seconds)
                )
            for job in itertools.islice(jobs, 4 * self.threads - len(waiting)):
                waiting.append((job, self._submit(pool, job)))
            if not waiting:
                return
            job, future = waiting[0]
            sums = future.result()
            # First out of the queue, then into the film: an interrupt between the two loses
            # a job and its weights; the other way round the job would count twice.
            waiting.popleft()
            self._finish(job, sums)

    def _submit(self, pool: ThreadPoolExecutor, job: _Job) -> Future[Any]:
        """Let a thread render a job; in a replay after the one before on the same tile.

        A pixel's stream of Mitsuba's numbers runs on from sample to sample. The job before
        was submitted before, so that it is done or under way: nobody waits for ever.
        """
        if not self.variant.in_order:
            return pool.submit(self._render, job)
        future = pool.submit(self._render_after, self._before.get(job.tile), job)
        self._before[job.tile] = future
        return future

    def _render_after(self, before: Future[Any] | None, job: _Job) -> Any:
        if before is not None:
            before.result()
        return self._render(job)

    def _finish(self, job: _Job, sums: Any) -> None:
        self.film.add(job.tile, sums)
        samples = job.end_sample - job.first_sample
        self.samples_done += job.tile.width * job.tile.height * samples
