"""Samples from the workers of a Dask cluster, with the same bits as in this process.

Dask starts processes, assigns tasks to workers, transfers data, and reassigns the tasks of
a lost worker. This module does the rest: a task contains the sums that its samples are
added to and returns them; a worker gets tasks only after it has shown that its bits are
equal; and a render that cannot continue ends with a message of one sentence.

Tasks are submitted and their results received in a separate thread, so that Ctrl-C, which
is raised in the main thread, never interrupts that.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from distributed import Client, Future, KilledWorker, as_completed
from numpy.typing import NDArray

from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.process.worker_pool import WorkerPool
from renderer.rendering.checkpoints.identity import made_by
from renderer.rendering.cluster import worker as work
from renderer.rendering.cluster.portions import Portion, Portions
from renderer.rendering.cluster.worker import Content
from renderer.rendering.film.film import Film
from renderer.rendering.job import RenderJob
from renderer.rendering.memory_estimate import check_room, estimate_workers
from renderer.rendering.render_options import RenderOptions

LOOK = 0.5  # [s] between two checks for new and lost workers
PAUSE = 0.005  # [s] between two checks for results
PATIENCE = 60.0  # [s] to wait without a worker, such as while all of them restart
AHEAD = 1  # portions queued per worker, in addition to those of its threads
RETRIES = 3  # of a portion that fails on workers that are not lost
MOST_DEATHS = 10  # losses of all workers that have a portion, until the render fails
AGAIN = 30.0  # [s] until a worker without memory is checked again: others may free some
LAST_WORDS = 5.0  # [s] to wait for running portions when a render is interrupted
CHECKED = 3  # tiles that a worker with another processor or Numba must reproduce


@dataclass
class Tally:
    """Statistics of a cluster since its first use; bytes are those of scenes and sums."""

    size: int = 0  # workers that may be used
    portions: int = 0  # received
    retried: int = 0  # submitted again because all workers that had them were lost
    bytes_sent: int = 0
    bytes_received: int = 0
    lost: set[str] = field(default_factory=set)  # addresses of lost workers
    refused: dict[str, str] = field(default_factory=dict)  # address -> reason
    later: dict[str, float] = field(default_factory=dict)  # refused -> end of the refusal
    shown_equal: dict[str, str] = field(default_factory=dict)  # address -> what differs

    def __str__(self) -> str:
        """Return a line for the user."""
        words = [_counted(self.portions, "portion")]
        words += [f"{self.retried} retried"] if self.retried else []
        for addresses, verb in ((self.lost, "lost"), (self.refused, "refused")):
            words += [f"{_counted(len(addresses), 'worker')} {verb}"] if addresses else []
        sent, received = self.bytes_sent / 1e6, self.bytes_received / 1e6
        return ", ".join([*words, f"{sent:.1f} MB sent, {received:.1f} MB received"])

    def refuse(self, address: str, error: BaseException) -> None:
        """Exclude a worker; without memory only for `AGAIN` seconds."""
        message = str(error)
        if not isinstance(error, SceneError | ClusterError):  # such as errors of unpickling
            message = f"{type(error).__name__}: {message}"
        self.refused[address] = message
        if isinstance(error, NotAllowed):
            self.later[address] = time.monotonic() + AGAIN

    def forgive(self) -> None:
        """Remove refusals that have expired."""
        for address in [a for a, end in self.later.items() if time.monotonic() > end]:
            del self.later[address]
            self.refused.pop(address, None)


class ClusterWorkers:
    """The workers of a client, for one or several simultaneous renders.

    Parameters
    ----------
    client : distributed.Client
        Connected, and not an asynchronous one.
    local : int
        Number of workers that share the memory of this machine, one thread each.
    """

    def __init__(self, client: Client, local: int = 0) -> None:
        self.client, self._local = client, local
        self.tally = Tally()
        self.pieces: dict[str, Any] = {}  # hash -> future of a part of a scene
        self._contents: dict[int, Content] = {}  # of the current renders

    def source(self, job: RenderJob, film: Film) -> ClusterTiles:
        """Return a source of samples for a film.

        Raises
        ------
        ClusterError, NotAllowed
            As `open`.
        """
        return ClusterTiles(self, job, film)

    def open(self, job: RenderJob) -> Content:
        """Send the scene of a render, except parts that the cluster already has.

        The pieces are results of tasks and are not scattered: Dask recomputes those that
        are lost with a worker.

        Raises
        ------
        ClusterError
            If a part of the scene cannot be sent.
        NotAllowed
            If workers that share this machine's memory need more than is available.
        """
        if self.client.status != "running":
            raise ClusterError(f"the client of the cluster is {self.client.status}")
        content = work.request_of(job)
        if self._local:  # otherwise each would count the same free memory
            self._check_local(job, content)
        for name, piece in content.pieces.items():
            known = self.pieces.pop(name, None)
            if known is None or known.status not in ("pending", "finished"):
                known = self.client.submit(bytes, piece, key=f"lightproof-{name}")
                self.tally.bytes_sent += len(piece)
            self.pieces[name] = known
        self._contents[id(job)] = content
        return content

    def close(self, job: RenderJob, content: Content) -> None:
        """Release pieces, except those of the last render: the next may share them."""
        self._contents.pop(id(job), None)
        kept = {n for each in [*self._contents.values(), content] for n in each.pieces}
        self.pieces = {name: f for name, f in self.pieces.items() if name in kept}

    def present(self) -> dict[str, int]:
        """Return the number of threads of each worker that the scheduler knows.

        Raises
        ------
        ClusterError
            If there is no scheduler any more.
        """
        client: Any = self.client
        scheduler = client.scheduler
        if scheduler is not None and client.status == "running":
            loop = client.loop.asyncio_loop
            asking = asyncio.run_coroutine_threadsafe(scheduler.ncores(), loop)
            last = time.monotonic() + PATIENCE
            # the client notices at once that a scheduler is gone; the call does not
            while client.status == "running" and time.monotonic() < last:
                try:
                    return dict(asking.result(LOOK))
                except TimeoutError:
                    continue
                except OSError:
                    break
            asking.cancel()
        where = "?" if scheduler is None else scheduler.address
        raise ClusterError(f"the scheduler at {where} went away")

    def _check_local(self, job: RenderJob, content: Content) -> None:
        needs = estimate_workers(
            job.scene,
            job.plan,
            RenderOptions(accel=job.options.accel, threads=1),
            workers=self._local,
            kernels=self.tally.portions == 0,
            # once as received bytes, and once unpacked
            scene_bytes=2 * sum(map(len, content.pieces.values())),
        )
        instead = f"fewer than {self._local} workers; threads, which share the scene"
        check_room(needs, job.scene.description.source, instead)


class _Task(NamedTuple):
    portion: Portion
    workers: frozenset[str]  # addresses of the workers that may run it


class ClusterTiles:
    """`TileSource` that adds the samples of a cluster's workers to a film."""

    def __init__(self, workers: ClusterWorkers, job: RenderJob, film: Film) -> None:
        self._workers, self._job, self._film = workers, job, film
        self._client, self._tally = workers.client, workers.tally
        self._content = workers.open(job)
        self._portions = Portions(film, film.samples.copy())  # none are missing yet
        loop = self._client.loop
        self._done = as_completed([], loop, with_results=True, raise_errors=False)
        self.begun = 0.0
        self._met: dict[str, bool] = {}  # worker -> true: may be used; false: being checked
        self._meetings: dict[Future[Any], str] = {}
        self._out: dict[Future[Any], _Task] = {}
        self._again: list[Portion] = []
        self._deaths: dict[Portion, int] = {}
        self._present: dict[str, int] = {}
        self._next_look = self._seen = self._rate = 0.0
        self._pool: WorkerPool | None = None
        self._stopping = False

    @property
    def note(self) -> str:
        """Progress line: workers in use, portions done, retried and lost, bytes."""
        return f"{_counted(self._tally.size, 'worker')}, {self._tally}"

    def start(self, wanted: NDArray[np.int64]) -> None:
        """See `TileSource`; in a sweep it is called before the loop."""
        if self._pool is not None and not self._stopping:
            return
        self.begun = self.begun or time.perf_counter()
        if (self._portions.wanted != wanted).any():
            self._portions = Portions(self._film, wanted)
        self._stopping = False
        self._seen = time.monotonic()
        self._run(self._deal)

    def wait(self) -> bool:
        """See `TileSource`."""
        return self._pool is None or self._pool.wait()

    def stop(self) -> None:
        """See `TileSource`; workers continue with their portions."""
        self._stopping = True
        if self._pool is not None:
            self._pool.stop()

    def end(self) -> None:
        """See `TileSource`; results of running portions are awaited for `LAST_WORDS`."""
        self.stop()
        if self._out or self._meetings:
            self._run(self._drain)
            while self._pool is not None and not self._pool.wait():
                pass
        self._pool = None
        self._workers.close(self._job, self._content)

    def _run(self, call: Callable[[], None]) -> None:
        self._pool = WorkerPool(1, 1, lambda number, thread: call())
        self._pool.start()

    # ------------------------------------------------------------ in the separate thread

    def _deal(self) -> None:
        """Submit portions and receive results until all is done or `stop` is called."""
        try:
            while not self._stopping and not self._finished:
                self._look_around()
                self._submit()
                self._take_in()
        except ClusterError:
            raise
        except Exception as error:  # the picture so far is kept
            message = " ".join(str(error).split())
            raise ClusterError(f"{type(error).__name__}: {message}") from error

    def _drain(self) -> None:
        last = time.monotonic() + LAST_WORDS
        with suppress(Exception):
            while self._out and time.monotonic() < last and self._alive:
                self._take_in()
        if self._alive:
            with suppress(Exception):
                self._client.cancel([*self._out, *self._meetings])
        self._out, self._meetings = {}, {}

    @property
    def _alive(self) -> bool:
        return self._client.status == "running"

    @property
    def _finished(self) -> bool:
        return not (self._portions.waiting or self._out or self._again)

    def _look_around(self) -> None:
        """Check new workers, and resubmit the portions of lost ones."""
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + LOOK
        self._present = present = self._workers.present()
        for address in set(self._met) - set(present):
            del self._met[address]
            self._tally.lost.add(address)
        self._tally.forgive()
        for address in present:
            if address not in self._met and address not in self._tally.refused:
                self._meet(address)
        self._tally.size = sum(self._met.values())
        for future, task in list(self._out.items()):
            if not task.workers & present.keys():
                self._give_back(future)
        refused = {a: why for a, why in self._tally.refused.items() if a in present}
        if present and len(refused) == len(present):
            address, why = next(iter(refused.items()))
            raise ClusterError(
                f"none of the cluster's {len(present)} workers may work: {address}: {why}"
            )
        if present:
            self._seen = now
        elif now - self._seen > PATIENCE:
            raise ClusterError(f"the cluster has had no worker for {PATIENCE:.0f} s")

    def _meet(self, address: str) -> None:
        """Submit the check of a worker, which must reproduce our bits if it differs."""
        portion, expected = self._proof
        future = self._task(work.meet, made_by(), portion, expected, workers=[address])
        self._met[address] = False
        self._meetings[future] = address

    @functools.cached_property
    def _proof(self) -> tuple[Portion, str]:
        """Return the first samples of some tiles, and a digest of their sums here."""
        portion = self._portions.sample(CHECKED)
        film, sums = self._film, []
        for place, begin, end in zip(*portion, strict=True):
            sums.append(np.zeros_like(film.sums[place]))
            self._job.add_to(sums[-1], film, place, begin, end, thread=0)
        return portion, hashlib.sha256(np.array(sums).tobytes()).hexdigest()

    def _task(self, call: Callable[..., Any], *arguments: Any, **how: Any) -> Future[Any]:
        names = self._content.names
        held = [self._workers.pieces[name] for name in self._content.pieces]
        future = self._client.submit(
            call, self._content.key, names, *arguments, *held, pure=False, **how
        )
        self._done.add(future)
        return future

    def _submit(self) -> None:
        """Submit as many portions as the workers need; Dask assigns them."""
        portions = self._portions
        good = [address for address in self._present if self._met.get(address)]
        threads = sum(self._present[address] for address in good)
        while len(self._out) < threads + AHEAD * len(good):
            if self._again:
                portion = self._again.pop(0)
            elif portions.waiting:
                portion = portions.take(portions.fair_share(self._rate, threads))
            else:
                return
            sums = portions.sums(portion)
            future = self._task(
                work.add_samples, portion, sums, workers=good, retries=RETRIES
            )
            self._out[future] = _Task(portion, frozenset(good))
            self._tally.bytes_sent += 0 if sums is None else sums.nbytes

    def _take_in(self) -> None:
        """Add the results that have arrived to the film."""
        batch = self._done.next_batch(block=False)
        if not batch:
            time.sleep(PAUSE)
        for future, result in batch:
            if future in self._meetings:
                self._answer(self._meetings.pop(future), future, result)
            elif future in self._out:
                if future.status == "finished":
                    self._add(self._out.pop(future).portion, *result)
                elif future.status == "error":
                    self._fail(self._out.pop(future).portion, result[1])
                elif self._alive:  # cancelled because its workers are lost
                    self._give_back(future)

    def _answer(self, address: str, future: Future[Any], result: Any) -> None:
        """Accept or refuse a worker by the result of its check."""
        if future.status == "finished":
            self._met[address] = True
            if result:
                self._tally.shown_equal[address] = result
        elif future.status == "error" and not isinstance(result[1], KilledWorker):
            self._tally.refuse(address, result[1])
            self._met.pop(address, None)
        else:  # it is lost; if it comes back, it is checked again
            self._met.pop(address, None)
        self._next_look = 0.0

    def _add(self, portion: Portion, sums: NDArray[np.float64], seconds: float) -> None:
        self._rate = self._portions.samples(portion) / max(seconds, 1e-6)
        self._portions.add(portion, sums)
        self._tally.portions += 1
        self._tally.bytes_received += sums.nbytes

    def _fail(self, portion: Portion, error: BaseException) -> None:
        if isinstance(error, KilledWorker):
            self._raise_deaths(portion, error.allowed_failures + 1)
        raise error

    def _give_back(self, future: Future[Any]) -> None:
        """Resubmit a portion whose workers are all lost."""
        portion = self._out.pop(future).portion
        future.cancel()
        self._tally.retried += 1
        self._again.append(portion)
        deaths = self._deaths[portion] = self._deaths.get(portion, 0) + 1
        if deaths >= MOST_DEATHS:
            self._raise_deaths(portion, deaths)

    def _raise_deaths(self, portion: Portion, deaths: int) -> None:
        raise ClusterError(
            f"{deaths} workers died one after the other at the same piece of work, "
            f"{self._portions.named(portion)}; their logs may say why, such as a lack of "
            "memory"
        )


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
