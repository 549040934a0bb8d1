"""`RenderJob`: adds samples to the sums of a film, for a scene and a plan."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import compile_builders
from renderer.integrators.direct import KEPT
from renderer.integrators.kind import Shown
from renderer.integrators.moment import show_moments, squared_sums
from renderer.integrators.render_tiles import render_tiles
from renderer.integrators.stages.film import BOX, FilterTable, filter_border, filter_table
from renderer.integrators.whitted import REGION
from renderer.kernels.jit import Method, Packed, compiled_for, pack
from renderer.kernels.records.batch import CAPACITY, TILE_SIZE, Workspace, make_workspace
from renderer.kernels.records.kernel_scene import KernelScene
from renderer.rendering.compilation import CompilationWatch
from renderer.rendering.film.band import FilmShape, FinishedTiles
from renderer.rendering.film.film import SAMPLES_PER_JOB, Film
from renderer.rendering.planning.plan import Plan
from renderer.rendering.progress_display import Progress
from renderer.rendering.render_options import RenderOptions
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.methods import INT, TILE, method_of
from renderer.rendering.tables.render_mode import mode_for
from renderer.rendering.user_kernels.check import blame_users
from renderer.scene.scene import Scene

# Minimum for small films, for many threads; not the number of threads: bits may not change.
SUMS_IN_ALL = 32


class RenderJob:
    """A scene, a plan, and the kernels' tables made of both; adds samples to sums.

    It stores no results, and may add to several films, in several threads simultaneously.

    Parameters
    ----------
    scene : Scene
        What is rendered.
    plan : Plan
        How it is rendered.
    options : RenderOptions
        The seed, the accelerator and the number of threads.

    Attributes
    ----------
    kernel_scene : KernelScene
        The kernels' record of the scene and the plan.
    shape : FilmShape
        Arguments of its films.
    level : int
        4 ** level samples of a pixel are traced together (`Tile`).
    """

    def __init__(self, scene: Scene, plan: Plan, options: RenderOptions) -> None:
        self.scene, self.plan, self.options = scene, plan, options
        self.threads = options.thread_count
        self.variant = mode_for(plan, options.measured_camera)
        # keeps the arrays alive that the addresses in the record point to
        self._inputs = KernelInputs(
            scene, plan, options.accelerator, options.seed, self.variant
        )
        self._packed_filter = pack(filter_of(scene, plan))
        self._compiled: Callable[..., None] | None = None  # function that calls the method
        self._workspaces: list[Packed | None] = [None] * self.threads
        self._use(self._inputs.record)
        lights = max(1, self.kernel_scene.lights.sampled.size) if plan.every_light else 1
        self._part = max(1, SAMPLES_PER_JOB // lights)
        self.level = min(plan.level, (self._part.bit_length() - 1) // 2)
        self.shape = film_shape(scene, plan)._replace(part=self._part)
        self.build_seconds = self.compile_seconds = 0.0  # see `build_job`

    def _use(self, record: KernelScene) -> None:
        self.kernel_scene = record
        self._trace, self._packed_scene = self.variant.traced(
            self.scene, self.plan, record, self.sampler.record
        )
        self._method: Method | None = None  # holds this record's address

    def with_record(self, record: KernelScene) -> RenderJob:
        """Return a copy with another record of the scene, such as other settings."""
        other = copy.copy(self)
        other._use(record)
        return other

    def make_film(self, *, keep_sums: bool = True) -> Film:
        """Return a film without samples.

        Parameters
        ----------
        keep_sums : bool
            False: tiles may be developed as soon as all their samples are added.
        """
        film, spp = Film(*self.shape), self.plan.spp
        if keep_sums or spp > self._part or not film.has_separate_tiles:
            return film
        return FinishedTiles(self.shape, self.threads, self._part // spp)

    @property
    def sampler(self) -> Packed:
        """The sampler's record, as kernels see it."""
        return self._inputs.sampler

    def make_workspace(self, channels: int) -> Workspace:
        """Allocate the buffers of one thread."""
        bsdfs = self.kernel_scene.bsdfs
        return workspace_of(
            self.plan,
            channels,
            self.shape.border,
            level=self.level,
            kinds=len(bsdfs.methods),
            parameters=len(bsdfs.values),
            previous_points=self.variant.previous_points,
        )

    def shown(self, developed: NDArray[np.float32]) -> Shown:
        """Return picture and AOVs for a film's channels (height, width, channels)."""
        kind, requested = self.plan.kind, self.scene.description.integrator
        if self.plan.moments is None:
            return kind.show(developed, requested)
        return show_moments(kind, developed, requested)

    def add_samples(self, film: Film, place: int, end: int, thread: int) -> None:
        """Add samples to a place until it holds `end`; nothing if it holds more.

        Threads may render different places simultaneously, each with its own number.
        """
        begin = int(film.samples[place])
        if end <= begin:
            return
        self.add_to(film.sums[place], film, place, begin, end, thread)
        film.samples[place] = end

    def add_to(
        self,
        sums: NDArray[np.float64],
        film: Film,
        place: int,
        begin: int,
        end: int,
        thread: int,
    ) -> None:
        """Add samples begin .. end - 1 of a place to `sums`: the film's, or a copy."""
        tile = place % film.work.tiles
        for first_sample, end_sample in film.work.pieces(place, begin, end):
            self._render(
                sums[None], film.tiles[tile : tile + 1], first_sample, end_sample, thread
            )

    def finish_tiles(self, film: FinishedTiles, strip: int, thread: int) -> None:
        """Trace and develop a strip of tiles, unless it is done."""
        first, end = film.strips[strip]
        spp = self.plan.spp
        if film.samples[first] < spp:
            sums = film.sums_of(strip, thread)
            self._render(sums, film.tiles[first:end], 0, spp, thread)
            film.finish(strip, sums)
            film.samples[first:end] = spp

    def _render(
        self,
        sums: NDArray[np.float64],
        tiles: NDArray[np.int64],
        first_sample: int,
        end_sample: int,
        thread: int,
    ) -> None:
        work = self._workspaces[thread]
        if work is None:
            work = self._workspaces[thread] = pack(self.make_workspace(self.shape.channels))
        if self._method is None:
            types = TILE, INT, work.numba_type
            self._method = method_of(self._trace, self._packed_scene, types)
        arguments = (
            *self._method,
            self._packed_filter,
            tiles,
            first_sample,
            end_sample,
            work,
            sums,
            self.shape.border,
            self.plan.squares(self.level),
        )
        try:
            if self._compiled is None:
                render_tiles(*arguments)
                self._compiled = compiled_for(render_tiles, *arguments)
            else:
                self._compiled(*arguments)
        except Exception as error:
            blame_users(error, self.scene.materials.kinds)
            raise

    @property
    def methods_seconds(self) -> float:
        """Seconds of the preparation in which kernels were compiled or loaded."""
        return self._inputs.compile_seconds

    def compile(self) -> float:
        """Compile the function that calls the methods, or load it; return the seconds."""
        start = time.perf_counter()
        film = Film(*self.shape._replace(width=1, height=1, sums_in_all=1))
        self._render(film.sums[:1], film.tiles[:1], 0, 0, thread=0)
        film.compile()
        return time.perf_counter() - start

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """State of a replay's random numbers, which continue from sample to sample."""
        if not self.variant.in_order:
            return {}
        streams = _arrays_of(self.sampler.record)
        return {f"stream {k}": stream for k, stream in enumerate(streams)}


def build_job(
    scene: Scene,
    plan: Plan,
    options: RenderOptions,
    progress: Callable[[Progress], None] | None,
) -> RenderJob:
    """Return a job whose accelerators are built and whose kernels are compiled."""

    def announce() -> None:
        if progress is not None:
            progress(Progress("compile", 0, 1, 0.0))

    watch = CompilationWatch(announce)
    with watch.installed():
        compile_seconds = compile_builders(scene, options.accelerator, plan.rays)
        started = time.perf_counter()
        job = RenderJob(scene, plan, options)
        job.build_seconds = time.perf_counter() - started - job.methods_seconds
        job.compile_seconds = compile_seconds + job.methods_seconds + job.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, job.compile_seconds))
    return job


def workspace_of(
    plan: Plan,
    channels: int,
    border: int,
    *,
    level: int,
    kinds: int,
    parameters: int,
    previous_points: bool,
) -> Workspace:
    """Allocate the buffers of one thread: a batch of rays, sums of a tile, parameters.

    `border` is the reach of the film's filter in pixels; 4 ** `level` samples of a pixel
    are traced together. The others are those of `make_workspace`.
    """
    depths, batch = 1, CAPACITY * plan.squares(level)
    capacity = batch
    if plan.kind.splits:
        depths = plan.max_depth + 1
        capacity = REGION * depths
    elif plan.several:
        capacity = KEPT + CAPACITY
    return make_workspace(
        ray_capacity=capacity,
        channels=channels,
        depths=depths,
        kinds=kinds,
        parameters=parameters,
        counted=plan.kind.counts_work,
        previous_points=previous_points or plan.kind.media,
        capacity=batch,
        splat_size=TILE_SIZE + 2 * border if border else 0,
        slots=CAPACITY << 2 * level,
        media=plan.kind.media,
        panes=plan.through_panes,
    )


def filter_of(scene: Scene, plan: Plan) -> FilterTable:
    """Return the table of the film's filter, with the channels that are squared."""
    table = filter_table(scene.description.camera.film.rfilter)
    if (
        plan.kind.counts_work
    ):  # counts have a box filter: they stay in their own pixel and can be added
        table = BOX
    if plan.moments is None:
        return table
    squares = squared_sums(plan.kind, scene.description.integrator)
    return table._replace(squares=squares)


def film_shape(scene: Scene, plan: Plan) -> FilmShape:
    """Return the arguments of the films of a render."""
    film, table = scene.description.camera.film, filter_of(scene, plan)
    return FilmShape(
        plan.kind.channels + (0 if table.squares is None else len(table.squares)),
        film.crop_offset_x + film.border,
        film.crop_offset_y + film.border,
        film.crop_width,
        film.crop_height,
        filter_border(table),
        film.width + 2 * film.border,
        film.border,
        # in a replay all samples of a pixel use one continuous stream of random numbers
        1 if plan.replay else SUMS_IN_ALL,
    )


def _arrays_of(record: Any) -> list[NDArray[Any]]:
    """Return all arrays of nested records."""
    if isinstance(record, np.ndarray):
        return [record]
    parts = record if isinstance(record, tuple) else ()
    return [array for part in parts for array in _arrays_of(part)]
