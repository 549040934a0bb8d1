"""One render: everything prepared, and what it has come to."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.direct import KEPT
from renderer.integrators.moment import squared_sums
from renderer.integrators.render_tiles import render_tiles
from renderer.integrators.stages.film.film import (
    BOX,
    FilterTable,
    filter_border,
    filter_table,
)
from renderer.integrators.whitted import REGION
from renderer.kernels.jit import Method, Packed, compiled_for, pack
from renderer.kernels.records.batch import CAPACITY, Workspace, make_workspace
from renderer.kernels.records.kernel_scene import KernelScene
from renderer.kernels.records.tile import TILE_SIZE
from renderer.rendering.accuracy import Accuracy
from renderer.rendering.film.band import Band, FilmShape
from renderer.rendering.film.film import Film
from renderer.rendering.film.finished_tiles import FinishedTiles
from renderer.rendering.film.work import Work
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.methods import INT, TILE, method_of
from renderer.rendering.tables.render_mode import mode_for
from renderer.rendering.user_kernels.check import blame_users
from renderer.scene.scene import Scene

# One job of a thread: so many samples of a tile, or of some together, that it takes
# milliseconds; 4 ** MOST_TOGETHER, as fewer would never go together.
SAMPLES_PER_JOB = 16
# Of a small film, for many threads; never of the threads, on which no bit may depend.
SUMS_IN_ALL = 32


class Rendering:
    """One render: everything prepared for a `RenderLoop` to trace.

    Parameters are those of `render`, with the `plan` made and every choice named; `band` is
    how many rows of tiles there are at a time, None for all of the film.

    Attributes
    ----------
    work : Work
        How samples are dealt out to the film's sums.
    samples_of_place : int64 (places,)
        How many each of `film.sums` holds. Both together are how far the render is: with
        those of another render of the same plan, in this process or not, it goes on there.
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
        band: int | None = None,
    ) -> None:
        self.scene, self.plan, self.threads = scene, plan, threads
        self.accel, self.seed = accel, seed
        self.variant = mode_for(plan, measured_camera)
        # keeps alive what the addresses in the record point to
        self._inputs = KernelInputs(scene, plan, accel, seed, self.variant)
        self.kernel_scene = self._inputs.record
        kind = plan.kind
        self._trace = kind.trace_several if plan.several else kind.trace
        self.counted = kind.counts_work
        self.rfilter = filter_of(scene, plan)
        self._packed_filter = pack(self.rfilter)
        self._compiled: Callable[..., None] | None = None  # what calls the method
        shape = film_shape(scene, plan)
        self.channels, self.border = shape.channels, shape.border
        asked = max(1, self.kernel_scene.lights.asked.size) if plan.every_light else 1
        self._part = max(1, SAMPLES_PER_JOB // asked)
        self.level = min(plan.level, (self._part.bit_length() - 1) // 2)  # of a `Tile`
        self.use_film(Film(*shape) if band is None else Band(shape, band))
        # what a sitting says about itself
        self.has_goal = False
        self.begun = 0.0  # when, on a cluster whose workers did before the sitting
        self.trouble = ""  # of a cluster, that ended it
        self.seconds = 0.0  # of tracing; with those before a checkpoint
        self.accuracy: Accuracy | None = None  # known where a goal asks for it
        self._workspaces: list[Packed | None] = [None] * threads

    def use_film(self, film: Film) -> None:
        """Begin anew, with another film of the same kind."""
        self.film = film
        self.without_sums: FinishedTiles | None = None  # if tiles are developed at once
        self.work = Work(len(film.tiles), film.grid.layers, self._part)
        self.samples_of_place = np.zeros(self.work.places, np.int64)
        pixels = film.tiles[:, 2] * film.tiles[:, 3]
        self.pixels = int(pixels.sum())
        self.pixels_of_place = np.tile(pixels, film.grid.layers)
        self.samples_in_all = self.pixels * self.plan.spp

    @property
    def kernel_scene(self) -> KernelScene:
        """What the kernels may look at; another one may be put in its place."""
        return self._record

    @kernel_scene.setter
    def kernel_scene(self, record: KernelScene) -> None:
        self._record, self._packed_scene = record, pack(record)
        self._method: Method | None = None  # holds this record's address

    @property
    def sampler(self) -> Packed:
        """The sampler's record, as kernels see it."""
        return self._inputs.sampler

    def make_workspace(self, channels: int) -> Workspace:
        """Allocate what one thread works in."""
        bsdfs = self.kernel_scene.bsdfs
        return workspace_of(
            self.plan,
            channels,
            self.border,
            level=self.level,
            kinds=len(bsdfs.methods),
            parameters=len(bsdfs.values),
            previous_points=self.variant.previous_points,
        )

    def add_samples(self, place: int, end: int, thread: int) -> None:
        """Let a place hold its samples up to number `end`; nothing if it holds more.

        Threads may be at different places at the same time, each with its own number.
        """
        assert self.without_sums is None
        begin = int(self.samples_of_place[place])
        if end <= begin:
            return
        self.add_to(self.film.sums[place], place, begin, end, thread)
        self.samples_of_place[place] = end

    def add_to(
        self, sums: NDArray[np.float64], place: int, begin: int, end: int, thread: int
    ) -> None:
        """Add samples begin .. end - 1 of a place to sums, the film's or such as these."""
        tile = place % self.work.tiles
        for first_sample, end_sample in self.work.pieces(place, begin, end):
            self._render(
                sums[None],
                self.film.tiles[tile : tile + 1],
                first_sample,
                end_sample,
                thread,
            )

    def finish_tiles(self, strip: int, thread: int) -> None:
        """Trace and develop a strip of the tiles without sums; nothing if they are done."""
        assert self.without_sums is not None
        first, end = self.without_sums.strips[strip]
        spp = self.plan.spp
        if self.samples_of_place[first] < spp:
            sums = self.without_sums.sums(strip, thread)
            self._render(sums, self.film.tiles[first:end], 0, spp, thread)
            self.without_sums.develop(strip, sums)
            self.samples_of_place[first:end] = spp

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
            work = self._workspaces[thread] = pack(self.make_workspace(self.channels))
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
            self.border,
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
        """The part of the preparation in which kernels were compiled or loaded."""
        return self._inputs.compile_seconds

    def compile(self) -> float:
        """Compile what calls the methods, or load it; return the seconds it took."""
        start = time.perf_counter()
        self._render(self.film.sums[:1], self.film.tiles[:1], 0, 0, thread=0)
        self.film.compile()
        return time.perf_counter() - start

    @property
    def spp(self) -> float:
        """Samples per pixel so far: their mean, where some tiles have more than others."""
        whole, rest = divmod(self.samples_done, self.pixels)
        return self.samples_done / self.pixels if rest else whole

    @property
    def samples_done(self) -> int:
        """Samples that are in the film, of all pixels together."""
        return int(self.samples_of_place @ self.pixels_of_place)

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """All that the render has come to: arrays from which another one may go on."""
        state = {"sums": self.film.sums, "samples": self.samples_of_place}
        if self.variant.in_order:
            streams = _arrays_of(self.sampler.record)
            state |= {f"stream {k}": stream for k, stream in enumerate(streams)}
        return state

    def keep_no_sums(self) -> None:
        """Let a sitting develop tiles when they have their samples, if that is in one job.

        Before the first sample, and without a goal, a checkpoint or a team; what `film`
        holds is nothing then.
        """
        assert not self.samples_of_place.any()
        spp = self.plan.spp
        if spp <= self._part and self.film.has_separate_tiles:
            self.film.compile()
            self.without_sums = FinishedTiles(self.film, self.threads, self._part // spp)

    def develop(self) -> NDArray[np.float32]:
        """Return what `Film.develop` does, of the samples that there are."""
        if self.without_sums is not None:
            return self.without_sums.picture(self.samples_of_place > 0)
        return self.film.develop(self.threads)


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
    """Allocate what one thread works in.

    `border` is the film's, `level` a `Tile`'s, the others are those of `make_workspace`.
    """
    depths, capacity = 1, CAPACITY
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
        previous_points=previous_points,
        splat_size=TILE_SIZE + 2 * border if border else 0,
        slots=CAPACITY << 2 * level,
    )


def filter_of(scene: Scene, plan: Plan) -> FilterTable:
    """Return the table of the film's filter, with what is squared."""
    table = filter_table(scene.description.camera.film.rfilter)
    if (
        plan.kind.counts_work
    ):  # counts stay in their own pixel, so that they can be added up
        table = BOX
    if plan.moments is None:
        return table
    squares = squared_sums(plan.kind, scene.description.integrator)
    return table._replace(squares=squares)


def film_shape(scene: Scene, plan: Plan) -> FilmShape:
    """Return what the film of a render is made of."""
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
        # in a replay a pixel's stream of random numbers runs on through all its samples
        1 if plan.replay else SUMS_IN_ALL,
    )


def _arrays_of(record: Any) -> list[NDArray[Any]]:
    """Return all arrays of a record of records."""
    if isinstance(record, np.ndarray):
        return [record]
    parts = record if isinstance(record, tuple) else ()
    return [array for part in parts for array in _arrays_of(part)]
