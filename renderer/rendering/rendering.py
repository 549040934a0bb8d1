"""One render under way: tiles over threads; an interrupt keeps the picture so far."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ClusterError
from renderer.integrators.direct import KEPT
from renderer.integrators.moment import squared_sums
from renderer.integrators.whitted import REGION
from renderer.jit import Packed, pack
from renderer.records.batch import CAPACITY, Workspace, make_workspace
from renderer.records.kernel_scene import KernelScene
from renderer.rendering.accuracy import Accuracy
from renderer.rendering.goal import Goal, Halves
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.variant import way_of
from renderer.rendering.work import Work
from renderer.scene.scene import Scene
from renderer.stages.film import BOX, Film, filter_border, filter_table
from renderer.threads import Crew

if TYPE_CHECKING:  # needs Dask, an extra
    from renderer.rendering.cluster.job import Job
    from renderer.rendering.cluster.team import Team

# One job of a thread: so many samples of a tile that it takes some 10 ms.
SAMPLES_PER_JOB = 16
# Of a small film, for many threads; never of the threads, on which no bit may depend.
SUMS_IN_ALL = 32


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
    # of the picture so far, where a goal asks for it: infinite before it is known
    error: float | None = None
    cluster: str = ""  # what is to be said of one: workers, bytes, what was retried


class Rendering:
    """One render: everything prepared, then `run`.

    Parameters are those of `render`, with the `plan` made and every choice named.

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
    ) -> None:
        self.scene, self.plan, self.threads = scene, plan, threads
        self.accel, self.seed = accel, seed
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
            film.width + 2 * film.border,
            film.border,
            # in a replay a pixel's stream of random numbers runs on through all its samples
            1 if self.variant.in_order else SUMS_IN_ALL,
        )
        asked = max(1, self.kernel_scene.lights.count) if plan.every_light else 1
        tiles, layers = self.film.tiles, self.film.grid.layers
        self.work = Work(len(tiles), layers, max(1, SAMPLES_PER_JOB // asked))
        self.samples_of_place = np.zeros(self.work.places, np.int64)
        pixels = [tile.width * tile.height for tile in tiles]
        self._pixels, self.pixels_of_place = sum(pixels), np.tile(pixels, layers)
        self.samples_in_all = self._pixels * plan.spp
        self.has_goal = self._ending = False
        self.trouble = ""
        self._team: Team | None = None
        self._job: Job | None = None  # that the team is at
        self.accuracy: Accuracy | None = None  # known where a goal asks for it
        self._workspaces: list[Packed | None] = [None] * threads

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

    def add_samples(self, place: int, end: int, thread: int) -> None:
        """Let a place hold its samples up to number `end`; nothing if it holds more.

        Threads may be at different places at the same time, each with its own number.
        """
        begin = int(self.samples_of_place[place])
        self.add_to(self.film.sums[place], place, begin, end, thread)
        if end > begin:
            self.samples_of_place[place] = end

    def add_to(
        self, sums: NDArray[np.float64], place: int, begin: int, end: int, thread: int
    ) -> None:
        """Add samples begin .. end - 1 of a place to sums, the film's or others."""
        for first_sample, end_sample in self.work.pieces(place, begin, end):
            self._render(sums, place, first_sample, end_sample, thread)

    def _render(
        self,
        sums: NDArray[np.float64],
        place: int,
        first_sample: int,
        end_sample: int,
        thread: int,
    ) -> None:
        work = self._workspaces[thread]
        if work is None:
            work = self._workspaces[thread] = pack(self.make_workspace(self.channels))
        self._render_tile(
            self._packed_scene,
            self._packed_filter,
            self.film.tiles[place % self.work.tiles],
            first_sample,
            end_sample,
            work,
            sums,
            self.border,
        )

    @property
    def methods_seconds(self) -> float:
        """The part of the preparation in which kernels were compiled or loaded."""
        return self._inputs.compile_seconds

    def compile(self) -> float:
        """Compile what calls the methods, or load it; return the seconds it took."""
        start = time.perf_counter()
        self._render(self.film.sums[0], 0, first_sample=0, end_sample=0, thread=0)
        self.film.compile()
        return time.perf_counter() - start

    @property
    def spp(self) -> int:
        """Samples of each pixel: those asked for, with a goal those that were taken."""
        return self.samples_done // self._pixels if self.has_goal else self.plan.spp

    @property
    def samples_done(self) -> int:
        """Samples that are in the film, of all pixels together."""
        return int(self.samples_of_place @ self.pixels_of_place)

    def run(
        self,
        progress: Callable[[Progress], None] | None = None,
        goal: Goal | None = None,
        team: Team | None = None,
    ) -> bool:
        """Trace all samples, or as many as a goal needs; return whether it went to the end.

        On the workers of a `team`, if there is one. What stopped it is then in `trouble`.

        An interrupt (Ctrl-C) ends the render after the jobs that are under way; one more
        while these end is raised.
        """
        start = time.perf_counter()
        self._team = team
        self.has_goal = goal is not None and self.plan.spp > 1

        def show() -> None:
            if progress is not None:
                seconds = time.perf_counter() - start
                total: int = self.samples_in_all
                error: float | None = None
                if goal is not None and self.has_goal:
                    total, error = self._expected(goal, seconds)
                note = "" if team is None else team.note
                done = self.samples_done
                progress(Progress("render", done, total, seconds, error, note))

        try:
            show()
            if goal is None or not self.has_goal:
                self._trace(self.plan.spp, show)
            else:
                self._trace_until(goal, start, show)
            show()
        except KeyboardInterrupt:
            if self._ending:  # one more, while threads are still at work
                raise
            return False
        except ClusterError as error:
            self.trouble = str(error)
            return False
        return True

    def _trace_until(self, goal: Goal, start: float, show: Callable[[], None]) -> None:
        halves = Halves(self.film)
        done, error, steady = 0, float("inf"), False
        while True:
            seconds = time.perf_counter() - start
            more = goal.next_samples(done, error, seconds, self.plan.spp, steady=steady)
            if more == 0:
                return
            middle, end = done + more // 2, done + more
            self._trace(middle, show)
            halves.end_first()
            self._trace(end, show)
            self.accuracy = halves.end_second(end, self.threads)
            done, error, steady = end, self.accuracy.error, self.accuracy.steady

    def _expected(self, goal: Goal, seconds: float) -> tuple[int, float]:
        """Return how many samples there will be, and the error of those that there are."""
        if self.accuracy is None:
            return self.samples_in_all, float("inf")
        done, error = self.accuracy.samples, self.accuracy.error
        spp = goal.expected_samples(done, error, seconds, self.plan.spp)
        return max(spp * self._pixels, self.samples_done), error

    def _trace(self, end_sample: int, show: Callable[[], None]) -> None:
        """Add what is missing of samples 0 .. end_sample - 1; call `show` meanwhile.

        Places may have come unequally far.
        """
        places, part = self.work.places, self.work.part
        wanted = self.work.samples(end_sample)
        if self._team is not None:
            self._trace_by(self._team, wanted, show)
            return
        begun = self.samples_of_place // part
        rounds = max(0, int((-(-wanted // part) - begun).max()))

        def work(job: int, thread: int) -> None:
            number, place = divmod(job, places)
            end = min((begun[place] + number + 1) * part, wanted[place])
            self.add_samples(place, int(end), thread)

        crew = Crew(self.threads, rounds * places, work, round_length=places)
        try:
            crew.start()
            while not crew.wait():
                show()
        finally:
            self._ending = True
            crew.stop()
            self._ending = False

    def begin(self, team: Team) -> None:
        """Let workers begin with all samples already; `run` or `end` follows."""
        self._team = team
        self._job = team.begin(self, self.work.samples(self.plan.spp))

    def end(self) -> None:
        """Let workers that have begun go on no longer."""
        if self._job is not None and self._team is not None:
            job, self._job = self._job, None
            self._team.end(job)

    def _trace_by(
        self, team: Team, wanted: NDArray[np.int64], show: Callable[[], None]
    ) -> None:
        if self._job is None:
            self._job = team.begin(self, wanted)
        try:
            team.wait(self._job, show)
        finally:
            self._ending = True
            self.end()
            self._ending = False
