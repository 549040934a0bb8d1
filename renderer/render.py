"""Rendering: tiles over a thread pool, with progress; an interrupt keeps the picture."""

from __future__ import annotations

import dataclasses
import itertools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.accelerators.build import NAMES as ACCELERATORS
from renderer.accelerators.build import compile_builders
from renderer.aovs import nested_scene, split_channels, with_picture
from renderer.batch import CAPACITY, Workspace, make_workspace
from renderer.compilation import CompilationWatch
from renderer.errors import SceneError
from renderer.film import Film, FilterTable, filter_border, filter_table, tile_sums
from renderer.image import Image
from renderer.integrators.render_tile import RENDER_TILE
from renderer.integrators.whitted import REGION
from renderer.kernel_inputs import kernel_scene
from renderer.kernel_scene import KernelScene
from renderer.plan import Plan, make_plan
from renderer.scene import Scene
from renderer.stages.camera_rays import Tile

# One job of a thread: so many samples of a tile that it takes some 10 ms.
SAMPLES_PER_JOB = 16
MOST_THREADS = 1024


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

    def __init__(self, make: Callable[[], Workspace]) -> None:
        self.make = make
        self.work: Workspace | None = None

    def get(self) -> Workspace:
        if self.work is None:
            self.work = self.make()
        return self.work


class Rendering:
    """One render: everything prepared, then `run`.

    Parameters are those of `render`.
    """

    def __init__(
        self, scene: Scene, plan: Plan, *, accel: str, seed: int, threads: int
    ) -> None:
        self.scene, self.plan, self.threads = scene, plan, threads
        self.kernel_scene: KernelScene = kernel_scene(scene, plan, accel, seed)
        self._render_tile, self.channels = RENDER_TILE[plan.method]
        film = scene.description.camera.film
        self.rfilter: FilterTable | None = filter_table(film.rfilter)
        self.border = filter_border(self.rfilter)
        self.film = Film(
            self.channels,
            film.crop_offset_x,
            film.crop_offset_y,
            film.crop_width,
            film.crop_height,
            self.border,
        )
        self.seed = seed
        self.samples_done = 0
        self.samples_in_all = film.crop_width * film.crop_height * plan.spp
        self._workspaces = _Workspaces(self._make_workspace)

    def _make_workspace(self) -> Workspace:
        lights = self.kernel_scene.lights
        asked = lights.count if lights is not None and self.plan.every_light else 1
        depths = self.plan.max_depth + 1 if self.plan.method == "whitted" else 1
        return make_workspace(
            ray_capacity=max(REGION * depths, CAPACITY),
            shadow_capacity=2 * asked * CAPACITY,
            channels=self.channels,
            depths=depths,
        )

    def _render(self, job: _Job) -> Any:
        sums = tile_sums(self.channels, self.border)
        self._render_tile(
            self.kernel_scene,
            self.rfilter,
            job.tile,
            job.first_sample,
            job.end_sample,
            self._workspaces.get(),
            sums,
            self.border,
        )
        return sums

    def compile(self) -> float:
        """Compile the kernels, or load them from the cache; return the seconds it took."""
        start = time.perf_counter()
        tile = self.film.tiles()[0]
        self._render(_Job(tile, 0, 0))
        return time.perf_counter() - start

    def _jobs(self) -> Iterator[_Job]:
        tiles = self.film.tiles()
        for first in range(0, self.plan.spp, SAMPLES_PER_JOB):
            for tile in tiles:
                yield _Job(tile, first, min(first + SAMPLES_PER_JOB, self.plan.spp))

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
        except KeyboardInterrupt:
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
                waiting.append((job, pool.submit(self._render, job)))
            if not waiting:
                return
            job, future = waiting[0]
            sums = future.result()
            # First out of the queue, then into the film: an interrupt between the two loses
            # a job and its weights; the other way round the job would count twice.
            waiting.popleft()
            self._finish(job, sums)

    def _finish(self, job: _Job, sums: Any) -> None:
        self.film.add(job.tile, sums)
        samples = job.end_sample - job.first_sample
        self.samples_done += job.tile.width * job.tile.height * samples


def default_threads() -> int:
    """Return the number of processors that this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


def render(
    scene: Scene,
    spp: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    integrator: str | None = None,
    accel: str | None = None,
    sampler: str | None = None,
    progress: Callable[[Progress], None] | None = None,
    ray_offset: str | None = None,
) -> Image:
    """Render a scene.

    Parameters
    ----------
    scene : Scene
        From `load_file`, `load_string` or `load_dict`.
    spp : int, optional
        Samples per pixel; None takes the file's.
    seed : int
        The same seed gives the same image, bit for bit, at any number of threads.
    threads : int, optional
        None takes all processors.
    integrator : str, optional
        `direct`, `whitted`, `path`, `depth` or `aov`; None or `auto` take the least
        method that gives what the file asks for.
    accel : str, optional
        `brute` or `bvh`; None or `auto` choose by the number of primitives.
    sampler : str, optional
        A sampler's name instead of the file's.
    progress : callable, optional
        Called with a `Progress` in the calling thread, several times a second.
    ray_offset : str, optional
        `tight` (the default) or `mitsuba`: how far off their surface new rays start.

    Returns
    -------
    Image
        float32 (height, width, 3) of the crop window, linear sRGB, and AOVs. After a
        KeyboardInterrupt the picture so far, with `complete` false.

    Raises
    ------
    SceneError
        For a name that does not exist or a number that is out of range.
    """
    threads = default_threads() if threads is None else threads
    if not 1 <= threads <= MOST_THREADS:
        raise SceneError(f"threads is {threads}; 1 to {MOST_THREADS} are possible")
    if not 0 <= seed < 2**32:
        raise SceneError(f"seed is {seed}; 0 to {2**32 - 1} are possible")
    accel = accel or "auto"
    if accel not in ACCELERATORS:
        known = ", ".join(ACCELERATORS)
        raise SceneError(f"accelerator {accel!r} is unknown; there are: {known}")
    plan = make_plan(
        scene,
        integrator=integrator,
        sampler=sampler,
        spp=spp,
        accel=accel,
        ray_offset=ray_offset,
    )

    def announce() -> None:
        if progress is not None:
            progress(Progress("compile", 0, 1, 0.0))

    watch = CompilationWatch(announce)
    with watch.installed():
        compile_seconds = compile_builders(scene, accel)
        started = time.perf_counter()
        rendering = Rendering(scene, plan, accel=accel, seed=seed, threads=threads)
        build_seconds = time.perf_counter() - started
        compile_seconds += rendering.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, compile_seconds))
    started = time.perf_counter()
    complete = rendering.run(progress)
    seconds = time.perf_counter() - started + build_seconds
    image = _image(rendering, seconds, compile_seconds, complete)
    nested = nested_scene(scene, plan)
    if nested is None or not complete:
        return image
    try:
        picture = render(
            nested,
            spp,
            seed,
            threads,
            accel=accel,
            sampler=sampler,
            progress=progress,
            ray_offset=ray_offset,
        )
    except KeyboardInterrupt:  # before its first sample
        interrupted = {"interrupted": "before the first sample of the colours"}
        metadata = {**image.metadata, **interrupted}
        return dataclasses.replace(image, complete=False, metadata=metadata)
    both = with_picture(image, picture)
    return dataclasses.replace(both, metadata={**picture.metadata, **image.metadata})


def _image(
    rendering: Rendering, seconds: float, compile_seconds: float, complete: bool
) -> Image:
    plan = rendering.plan
    developed = rendering.film.develop()
    aovs: dict[str, Any] = {}
    kinds: dict[str, str] = {}
    pixels = developed
    if plan.method in ("depth", "aov"):
        pixels, aovs, kinds = split_channels(rendering.scene, plan, developed)
    return Image(
        np.ascontiguousarray(pixels),
        aovs=aovs,
        aov_kinds=kinds,
        spp=plan.spp,
        seconds=seconds,
        compile_seconds=compile_seconds,
        threads=rendering.threads,
        integrator=plan.method,
        explain="\n".join(plan.lines),
        metadata=_metadata(rendering, complete),
        complete=complete,
    )


def _metadata(rendering: Rendering, complete: bool) -> dict[str, str]:
    """Return what a file should say about its making; the same for the same picture."""
    from renderer import __version__

    metadata = {
        "lightproof": __version__,
        "integrator": rendering.plan.method,
        "sampler": rendering.plan.sampler.name,
        "seed": str(rendering.seed),
    }
    if not complete:
        done, samples = rendering.samples_done, rendering.samples_in_all
        metadata["interrupted"] = f"after {done} of {samples} samples"
    return metadata
