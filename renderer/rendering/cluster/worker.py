"""What runs on a worker: samples of places, added to the sums that came with them.

A worker keeps nothing that matters. Each piece of work brings the sums that it goes on
from and takes them back, so that a worker may be lost at any moment.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pickle
import queue
import signal
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ClusterError
from renderer.process.worker_pool import in_own_thread
from renderer.rendering.checkpoints.identity import made_by
from renderer.rendering.cluster.content import Content, Name, freeze, thaw
from renderer.rendering.cluster.plugin_files import PluginFiles
from renderer.rendering.cluster.portions import Portion
from renderer.rendering.film.film import Film
from renderer.rendering.job import RenderJob
from renderer.rendering.memory_estimate import check_room, estimate_workers
from renderer.rendering.options import RenderOptions
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import build_scene
from renderer.scene_file.description import SceneDescription

KEPT = 3  # scenes that a process keeps ready: those of neighbours in a sweep
MOST_THREADS = 256  # of one worker
INSTEAD = "a worker with more memory, or one with many threads in the place of several"


class Request(NamedTuple):
    """What a worker has to know of a render."""

    plugins: PluginFiles | None  # first, so that it is read first
    description: SceneDescription
    plan: Plan
    options: RenderOptions


def request_of(job: RenderJob) -> Content:
    """Return what a worker has to know of a render, frozen.

    Raises
    ------
    ClusterError
        If something in it cannot be sent.
    """
    scene = job.scene
    if job.plan.replay:
        raise ClusterError(
            "a replay of Mitsuba's random numbers has a stream for each pixel, which each "
            "sample leaves where the next one begins; these stay in one process, as they "
            "are not sent with the sums; render it without a cluster"
        )
    options = RenderOptions(**job.options.only("travels"))
    request = Request(PluginFiles(), scene.description, job.plan, options)
    try:
        return freeze(request)
    except (TypeError, AttributeError, pickle.PicklingError) as error:
        raise ClusterError(
            f"{scene.description.source}: this cannot be sent to workers: {error}"
        ) from None


class _Ready(NamedTuple):
    job: RenderJob
    film: Film  # without samples: it knows tiles and the order of samples
    threads: queue.SimpleQueue[int]  # numbers of workspaces that are free


_ready: OrderedDict[str, _Ready] = OrderedDict()
_one_prepares = threading.Lock()


def meet(
    key: str,
    names: Sequence[Name],
    ours: dict[str, str],
    portion: Portion,
    expected: str,
    *held: bytes,
) -> str:
    """Let this worker get ready for a render; return in what it differs from the client.

    Parameters
    ----------
    key, names, held
        The `Request`, see `content`.
    ours : dict
        What runs at the client.
    portion : Portion
        Samples that a worker which differs renders, to show that its bits are the same.
    expected : str
        The SHA-256 of their sums.

    Raises
    ------
    ClusterError
        If this worker has another lightproof, or other bits.
    SceneError
        If it cannot read the scene, or has not the memory.
    """
    theirs = made_by()
    differ = [
        f"{name} ({theirs.get(name)}, here {value})"
        for name, value in ours.items()
        if theirs.get(name) != value
    ]
    if any(name.startswith("lightproof ") for name in differ):
        raise ClusterError(f"it has another {differ[0]}")
    _prepared(key, names, held)
    if differ:
        sums, _ = add_samples(key, names, portion, None, *held)
        if hashlib.sha256(sums.tobytes()).hexdigest() != expected:
            listed = ", ".join(differ)
            raise ClusterError(f"its sums are not ours, nor is its {listed}")
    return ", ".join(differ)


def add_samples(
    key: str,
    names: Sequence[Name],
    portion: Portion,
    sums: NDArray[np.float64] | None,
    *held: bytes,
) -> tuple[NDArray[np.float64], float]:
    """Return the sums of some places with the samples of a portion added, and the seconds.

    Parameters
    ----------
    key, names, held
        The `Request`, see `content`.
    portion : Portion
        Which samples.
    sums : float64 (places, channels + 1, rows, columns), or None
        What the places hold; None: nothing yet.
    """
    job, film, threads = _prepared(key, names, held)
    start = time.perf_counter()
    count = len(portion.places)
    if sums is None:
        result = np.zeros((count, *film.sums.shape[1:]))
    else:
        result = np.array(sums)  # one's own: what came is only to be read
    thread = threads.get()

    def trace() -> None:
        for k, samples in enumerate(zip(*portion, strict=True)):
            job.add_to(result[k], film, *samples, thread)

    try:
        in_own_thread(trace)
    finally:
        threads.put(thread)
    return result, time.perf_counter() - start


def _prepared(key: str, names: Sequence[Name], held: Sequence[bytes]) -> _Ready:
    """Return a job that is ready to trace; the last few are kept."""
    with _one_prepares:
        if key not in _ready:
            request: Request = thaw(names, held)
            _ready[key] = _make_ready(request)
            while len(_ready) > KEPT:
                _ready.popitem(last=False)
        _ready.move_to_end(key)
        return _ready[key]


def _make_ready(request: Request) -> _Ready:
    """Build a request; raise NotAllowed if it takes more memory than there is."""
    scene = build_scene(request.description)
    options = dataclasses.replace(request.options, threads=_threads_here())
    needs = estimate_workers(scene, request.plan, options)
    check_room(needs, scene.description.source, INSTEAD)
    options = dataclasses.replace(options, threads=MOST_THREADS)
    job = RenderJob(scene, request.plan, options)
    job.compile()
    threads: queue.SimpleQueue[int] = queue.SimpleQueue()
    for number in range(MOST_THREADS):
        threads.put(number)
    return _Ready(job, job.make_film(), threads)


def _threads_here() -> int:
    """Return how many portions this worker traces at a time; 1 where there is no worker."""
    from distributed import get_worker

    try:
        return int(get_worker().state.nthreads)
    except ValueError:
        return 1


def dask_setup(process: Any) -> None:
    """Let Ctrl-C in a terminal, which all processes there get, end the render alone.

    Dask calls it in the workers of `local:N`, which end with their cluster.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
