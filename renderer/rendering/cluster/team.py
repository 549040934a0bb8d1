"""The workers of a Dask cluster, and who of them does what.

Dask starts processes, carries bytes and sees who is there. Who does what is settled here,
so that it is known: each portion goes to one worker, which has shown that its bits are
ours, and back into the film when it comes in. What a lost worker had goes to another one;
what a slow one has is given to an idle one too, and the first answer counts. All of this
runs in the thread of the client's event loop, where no Ctrl-C can fall into it.
"""

from __future__ import annotations

import asyncio
import queue
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from distributed import Client
from numpy.typing import NDArray

from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.rendering.checkpoints.identity import made_by
from renderer.rendering.cluster import worker as work
from renderer.rendering.cluster.job import Job
from renderer.rendering.cluster.tally import Tally
from renderer.rendering.cluster.worker import Portion
from renderer.rendering.memory_estimate import check_room, estimate_workers
from renderer.rendering.options import RenderOptions
from renderer.rendering.rendering import Rendering

LOOK = 0.5  # [s] between two looks at who is there
WAKE = 0.05  # [s] between two looks of the thread that waits
PATIENCE = 60.0  # [s] without a worker, such as while all of them are started again
AHEAD = 1  # portions that wait at a worker beside those that it is at
# A portion that takes longer than so many usual ones, and so many seconds, is given to an
# idle worker too.
SLOW, SLOW_SECONDS = 4.0, 2.0
MOST_FAILURES = 3  # of one portion, on workers that live
MOST_DEATHS = 10  # of workers that were at one portion
AGAIN = 30.0  # [s] until a worker without memory is asked again: others may give it back
LAST_WORDS = 5.0  # [s] for portions that are under way when a render is interrupted
CHECKED = 3  # tiles that a worker with another processor or Numba must get right


@dataclass(eq=False)
class Worker:
    """A worker that may work."""

    address: str
    threads: int
    differs: str = ""  # in what, which has to be shown harmless for each job
    shown: set[str] = field(default_factory=set)  # keys of jobs for which it was
    rate: float = 0.0  # samples per second of one thread; 0: not known
    job: Job | None = None  # whose scene it has ready
    has: list[Task] = field(default_factory=list)  # in the order in which they came


@dataclass(eq=False)
class Task:
    """A portion that is out."""

    job: Job
    portion: Portion
    sums: NDArray[np.float64] | None
    started: float = 0.0
    at: dict[Worker, Any] = field(default_factory=dict)  # who has it -> the future
    failures: int = 0
    deaths: int = 0  # of workers that were at it
    over: bool = False


class ClusterScheduler:
    """The workers behind a client.

    Parameters
    ----------
    client : distributed.Client
        Connected, and not an asynchronous one.
    local : int
        How many workers share the memory of this machine, processes of one thread each.
    """

    def __init__(self, client: Client, local: int = 0) -> None:
        self.client, self._local = client, local
        self.tally = Tally()
        self.size = 0  # workers that may work, when they were last counted
        self._known: dict[str, Worker] = {}  # all that may work, whether there or not
        self._slots: dict[str, list[asyncio.Task[None]]] = {}  # of those that are there
        self._jobs: list[Job] = []
        self._errands: list[Task] = []  # that somebody has
        self._again: list[Task] = []  # that nobody has any more
        self._later: dict[str, float] = {}  # refused -> when it is asked again
        self._pieces: dict[str, Any] = {}  # hash -> future of a part of a scene
        self._watch: asyncio.Task[None] | None = None
        self._error: BaseException | None = None
        self._usual = 0.0  # [s] that a portion takes

    @property
    def note(self) -> str:
        """A line about workers and what was done."""
        return f"{self.size} worker{'' if self.size == 1 else 's'}, {self.tally}"

    # --------------------------------------------------------------- in the user's thread

    def begin(self, rendering: Rendering, wanted: NDArray[np.int64]) -> None:
        """Let the workers begin with a render; it goes on until `end`.

        Raises
        ------
        ClusterError
            If something in the scene cannot be sent.
        NotAllowed
            If workers that share this machine's memory take more than there is.
        """
        if self.client.status != "running":
            raise ClusterError(f"the client of the cluster is {self.client.status}")
        job = Job(rendering, wanted, work.request_of(rendering))
        if self._local:  # each of them would find the same memory free
            _check_local(job, self._local, loaded=self.tally.portions > 0)
        self._in_loop(self._add_job(job))

    def trace(
        self, rendering: Rendering, wanted: NDArray[np.int64], look: Callable[[], None]
    ) -> None:
        """Wait for the end of a render, begun or not; call `look` meanwhile.

        Raises
        ------
        ClusterError
            If the cluster cannot do it.
        """
        job = self._job_of(rendering)
        if job is None:
            self.begin(rendering, wanted)
            job = self._job_of(rendering)
        while job is not None and not job.finished:
            if self._error is not None:
                raise _as_ours(self._error)
            look()
            try:
                job.news.get(timeout=WAKE)
            except queue.Empty:
                pass

    def end(self, rendering: Rendering) -> None:
        """Let no worker begin with more of a render; take in what they are at."""
        job = self._job_of(rendering)
        if job is not None:
            self._in_loop(self._remove_job(job))

    def meanwhile(self, call: Callable[[], None]) -> None:
        """Call something while nothing comes into any film."""

        async def alone() -> None:
            call()

        self._in_loop(alone())

    def _job_of(self, rendering: Rendering) -> Job | None:
        jobs = [job for job in self._jobs if job.rendering is rendering]
        return jobs[0] if jobs else None

    def _in_loop(self, coroutine: Coroutine[Any, Any, None]) -> None:
        loop: Any = self.client.loop
        loop = loop.asyncio_loop
        asyncio.run_coroutine_threadsafe(coroutine, loop).result()

    # ------------------------------------------------------------- in the client's loop

    async def _add_job(self, job: Job) -> None:
        if not self._jobs:
            self._error = None
            self._news = asyncio.Condition()
        self._send_pieces(job)
        self._jobs.append(job)
        if self._watch is None:
            self._watch = asyncio.create_task(self._look_around())
        await self._tell()

    def _send_pieces(self, job: Job) -> None:
        """Give the scheduler what no job before has sent; workers take it from there.

        As results of tasks, and not scattered: what is lost with a worker is then made
        again by Dask.
        """
        for name, piece in job.content.pieces.items():
            known = self._pieces.pop(name, None)
            if known is not None and known.status in ("pending", "finished"):
                self._pieces[name] = known
            else:
                key = f"lightproof-{name}"
                self._pieces[name] = self.client.submit(bytes, piece, key=key)
                self.tally.bytes_sent += len(piece)

    async def _remove_job(self, job: Job) -> None:
        self._jobs.remove(job)
        last = time.monotonic() + LAST_WORDS
        while self._out(job) and self._error is None and time.monotonic() < last:
            await asyncio.sleep(WAKE / 10)
        for errand in [*self._out(job), *self._again]:
            if errand.job is job:
                await self._finish(errand)
        self._again = [errand for errand in self._again if errand.job is not job]
        # those of the last one too: the next in a sweep shares most of them
        kept = {name for other in [*self._jobs, job] for name in other.content.pieces}
        self._pieces = {n: f for n, f in self._pieces.items() if n in kept}
        if self._jobs:
            return
        if self._watch is not None:
            self._watch.cancel()
            self._watch = None
        for address in list(self._slots):
            await self._dismiss(address)

    def _out(self, job: Job) -> list[Task]:
        return [errand for errand in self._errands if errand.job is job]

    async def _tell(self) -> None:
        async with self._news:
            self._news.notify_all()

    async def _look_around(self) -> None:
        """See who comes and who goes, as long as there is a job."""
        seen = time.monotonic()
        try:
            while True:
                present = await self._present()
                for address in set(self._slots) - set(present):
                    self.tally.lost += 1
                    self._count_death(self._known.pop(address, None))
                    await self._dismiss(address)
                self._ask_again()
                for address in set(present) - set(self._slots) - set(self.tally.refused):
                    slot = asyncio.create_task(self._meet(address, present[address]))
                    self._slots[address] = [slot]
                self.size = sum(address in self._known for address in self._slots)
                if self._slots:
                    seen = time.monotonic()
                self._check_hope(present, time.monotonic() - seen)
                await self._tell()
                await asyncio.sleep(LOOK)
        except Exception as error:
            self._error = error

    def _count_death(self, worker: Worker | None) -> None:
        """Blame a lost worker's portions, of those that wait at it none.

        Raises
        ------
        ClusterError
            If one of them has cost so many workers that it would cost all that come.
        """
        for errand in [] if worker is None else worker.has[: worker.threads]:
            errand.deaths += 1
            if errand.deaths >= MOST_DEATHS:
                raise ClusterError(
                    f"{errand.deaths} workers died one after the other at the same piece "
                    f"of work, {errand.job.named(errand.portion)}; their logs may say why, "
                    "such as a lack of memory"
                )

    def _ask_again(self) -> None:
        """Let those try again whom something may have helped since they were refused."""
        for address, moment in list(self._later.items()):
            if time.monotonic() > moment:
                del self._later[address]
                self.tally.refused.pop(address, None)

    async def _present(self) -> dict[str, int]:
        """Return the number of threads of each worker that the scheduler knows."""
        scheduler: Any = self.client.scheduler
        where = "?" if scheduler is None else scheduler.address
        if scheduler is not None:
            asking = asyncio.ensure_future(scheduler.ncores())
            last = time.monotonic() + PATIENCE
            # the client notices at once that a scheduler is gone, the question does not
            while self.client.status == "running" and time.monotonic() < last:
                done, _ = await asyncio.wait({asking}, timeout=LOOK)
                if done and asking.exception() is None:
                    return dict(asking.result())
                if done:
                    break
            asking.cancel()
        raise ClusterError(f"the scheduler at {where} went away")

    def _check_hope(self, present: dict[str, int], lonely: float) -> None:
        refused = {a: why for a, why in self.tally.refused.items() if a in present}
        if present and len(refused) == len(present):
            address, why = next(iter(refused.items()))
            raise ClusterError(
                f"none of the cluster's {len(present)} workers may work: {address}: {why}"
            )
        if lonely > PATIENCE:
            raise ClusterError(f"the cluster has had no worker for {PATIENCE:.0f} s")

    async def _dismiss(self, address: str) -> None:
        slots = self._slots.pop(address, [])
        for slot in slots:
            slot.cancel()
        await asyncio.gather(*slots, return_exceptions=True)

    async def _meet(self, address: str, threads: int) -> None:
        """Ask a worker what it is, and let it work if its bits are ours."""
        if address not in self._known:
            worker = Worker(address, threads)
            try:
                theirs = await self.client.submit(
                    work.introduce, workers=[address], pure=False
                )
            except CancelledError:
                del self._slots[address]  # at the next look it is there, or not
                return
            except Exception as error:  # whatever unpickling or importing raises there
                return self._refuse(worker, f"{type(error).__name__}: {error}")
            differ = [
                f"{name} ({theirs.get(name)}, here {ours})"
                for name, ours in made_by().items()
                if theirs.get(name) != ours
            ]
            if any(name.startswith("lightproof ") for name in differ):
                return self._refuse(worker, f"it has another {differ[0]}")
            worker.differs = ", ".join(differ)
            self._known[address] = worker
        worker = self._known[address]
        slots = [self._serve(worker) for _ in range(worker.threads + AHEAD)]
        self._slots[address] = [asyncio.create_task(slot) for slot in slots]
        self.size = sum(address in self._known for address in self._slots)

    def _refuse(self, worker: Worker, why: str, *, later: bool = False) -> None:
        """Give a worker nothing more, or not until `AGAIN` has passed."""
        self.tally.refused[worker.address] = why
        if later:
            self._later[worker.address] = time.monotonic() + AGAIN
        self._known.pop(worker.address, None)
        for slot in self._slots.pop(worker.address, []):
            if slot is not asyncio.current_task():
                slot.cancel()

    # ------------------------------------------------------------------- one by one

    async def _serve(self, worker: Worker) -> None:
        """Give a worker one portion after the other."""
        try:
            while worker.address in self._known:
                errand = self._choose(worker)
                if errand is None:
                    async with self._news:
                        await self._news.wait()
                else:
                    await self._send(errand, worker)
        except Exception as error:  # of ours: without a word, a render would wait for ever
            self._error = error

    def _choose(self, worker: Worker) -> Task | None:
        if self._again:
            return self._again.pop(0)
        waiting = [job for job in self._jobs if job.waiting]
        if waiting:
            # a worker stays with the scene that it has ready, else goes where few are
            doing = [other.job for other in self._known.values()]
            job = min(waiting, key=lambda j: (j is not worker.job, doing.count(j)))
            worker.job = job
            portion = job.take(job.fair_share(worker.rate, self._threads()))
            return Task(job, portion, job.sums(portion))
        return self._slow(worker)

    def _threads(self) -> int:
        return sum(w.threads for a, w in self._known.items() if a in self._slots)

    def _slow(self, worker: Worker) -> Task | None:
        """Return what another worker has had for long, if this one has nothing at all."""
        if any(worker in errand.at for errand in self._errands):
            return None
        limit = time.monotonic() - max(SLOW_SECONDS, SLOW * self._usual)
        for errand in self._errands:
            if errand.started < limit and len(errand.at) == 1:
                self.tally.doubled += 1
                return errand
        return None

    async def _send(self, errand: Task, worker: Worker) -> None:
        """Let a worker do an errand; if it fails, somebody else will."""
        job = errand.job
        if errand not in self._errands:
            errand.started = time.monotonic()
            self._errands.append(errand)
        errand.at[worker] = None
        worker.has.append(errand)
        try:
            if worker.differs and job.key not in worker.shown:
                await self._show_equal(worker, job)
            future = self._submit(worker, job, errand.portion, errand.sums)
            errand.at[worker] = future
            if errand.sums is not None:
                self.tally.bytes_sent += errand.sums.nbytes
            sums, seconds = await future
        except asyncio.CancelledError:  # the worker is gone, or no longer wanted
            await self._leave(errand, worker)
            raise
        except Exception as error:
            if not errand.over:
                if isinstance(error, SceneError):  # we could read it: it is the worker's
                    self._refuse(worker, str(error), later=isinstance(error, NotAllowed))
                else:
                    errand.failures += self.client.status == "running"
                if errand.failures > MOST_FAILURES:
                    self._error = _as_ours(error, f"worker {worker.address}: ")
                await self._leave(errand, worker)
                await asyncio.sleep(WAKE)
            return
        finally:
            worker.has.remove(errand)
        if not errand.over:
            samples = job.samples(errand.portion)
            worker.rate = samples / max(seconds, 1e-6)
            self._usual = time.monotonic() - errand.started
            self.tally.portions += 1
            self.tally.bytes_received += sums.nbytes
            job.add(errand.portion, sums)
            await self._finish(errand, but=worker)
            await self._tell()

    def _submit(
        self,
        worker: Worker,
        job: Job,
        portion: Portion,
        sums: NDArray[np.float64] | None,
    ) -> Any:
        held = [self._pieces[name] for name in job.content.pieces]
        return self.client.submit(
            work.add_samples,
            job.key,
            job.content.names,
            portion,
            sums,
            *held,
            workers=[worker.address],
            pure=False,
        )

    async def _leave(self, errand: Task, worker: Worker) -> None:
        """Take an errand from a worker; if nobody else has it, it waits for one."""
        del errand.at[worker]
        if not errand.at and not errand.over:
            self._errands.remove(errand)
            self._again.append(errand)
            self.tally.retried += 1
            await self._tell()

    async def _finish(self, errand: Task, but: Worker | None = None) -> None:
        """Let whoever has an errand too stop it."""
        errand.over = True
        if errand in self._errands:
            self._errands.remove(errand)
        futures = [f for w, f in errand.at.items() if w is not but and f is not None]
        if futures and self.client.status == "running":
            await self.client.cancel(futures, asynchronous=True)

    async def _show_equal(self, worker: Worker, job: Job) -> None:
        """See whether a worker that is not like us has our bits, on tiles of this scene."""
        portion = job.sample(CHECKED)
        theirs, _ = await self._submit(worker, job, portion, None)
        if job.checked is None:
            job.checked = await self._checked_here(worker, job, portion)
        if theirs.tobytes() != job.checked:
            self._refuse(worker, f"its sums are not ours, nor is its {worker.differs}")
            raise ClusterError(f"{worker.address} was refused")
        self.tally.shown_equal[worker.address] = worker.differs
        worker.shown.add(job.key)

    async def _checked_here(self, worker: Worker, job: Job, portion: Portion) -> bytes:
        """Return what a worker's sums are compared with."""
        held = job.content.pieces.values()
        try:
            ours, _ = await asyncio.to_thread(
                work.add_samples, job.key, job.content.names, portion, None, *held
            )
        except NotAllowed as error:
            raise NotAllowed(
                f"it has {worker.differs}, and on this side is no memory to see whether "
                f"its sums are ours: {error}"
            ) from None
        return ours.tobytes()


def _check_local(job: Job, workers: int, *, loaded: bool) -> None:
    rendering = job.rendering
    needs = estimate_workers(
        rendering.scene,
        rendering.plan,
        RenderOptions(accel=rendering.accel, threads=1),
        workers=workers,
        kernels=not loaded,
        # as bytes that came, and unpacked
        scene_bytes=2 * sum(map(len, job.content.pieces.values())),
    )
    instead = f"fewer than {workers} workers; threads, which share the scene"
    check_room(needs, rendering.scene.description.source, instead)


def _as_ours(error: BaseException, where: str = "") -> ClusterError:
    """Return an error as one after which a render keeps what it has."""
    if isinstance(error, ClusterError):
        return error
    message = " ".join(str(error).split())
    ours = ClusterError(f"{where}{type(error).__name__}: {message}")
    ours.__cause__ = error
    return ours
