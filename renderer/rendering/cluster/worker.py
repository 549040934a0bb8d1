"""Code that runs on a worker of a cluster, and serialization of the scene.

A scene and a task are serialized to bytes that are identified by their hash.

Workers share no disk with the client. They get the description as it was read, with the
contents of all its files. Large arrays are separate pieces, each under its hash: a sweep of
pictures that share a mesh sends the mesh once.

Unpickling runs code, here and everywhere in Dask: all machines of a cluster must trust each
other (docs/cluster.md).
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pickle
import queue
import signal
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ClusterError, SceneError
from renderer.kernels.jit import with_neighbours
from renderer.process.cache_folder import cache_folder, cache_root
from renderer.process.whole_file import write_whole
from renderer.process.worker_pool import in_own_thread
from renderer.rendering.checkpoints.identity import made_by
from renderer.rendering.cluster.portions import Portion
from renderer.rendering.film.film import Film
from renderer.rendering.job import RenderJob
from renderer.rendering.memory_estimate import check_room, estimate_workers
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import build_scene
from renderer.scene_file import plugins as plugin_file
from renderer.scene_file.description import SceneDescription

LEAST = 1 << 16  # [bytes] arrays of this size are separate pieces
Name = tuple[str, bool]  # a hash, and whether the array is writable


class Content(NamedTuple):
    """A serialized object: its pickle, and its large arrays."""

    names: tuple[Name, ...]  # of the pickle, then of the arrays in the order of their use
    pieces: Mapping[str, bytes]  # by hash, each once, in the order of the names

    @property
    def key(self) -> str:
        """Hash of all pieces."""
        return hashlib.sha256(repr(self.names).encode()).hexdigest()[:32]


def freeze(thing: Any) -> Content:
    """Serialize an object.

    Raises
    ------
    TypeError, AttributeError, pickle.PicklingError
        If a part of it cannot be sent, such as a function defined at a prompt.
    """
    arrays: list[tuple[Name, bytes]] = []

    def keep_inside(buffer: pickle.PickleBuffer) -> bool:
        with buffer.raw() as view:
            if view.nbytes < LEAST:
                return True
            held = bytes(view)
            arrays.append(((_hash(held), not view.readonly), held))
        return False

    skeleton = pickle.dumps(thing, protocol=5, buffer_callback=keep_inside)
    parts = [((_hash(skeleton), False), skeleton), *arrays]
    return Content(
        tuple(name for name, _ in parts), {name: held for (name, _), held in parts}
    )


def _hash(held: bytes) -> str:
    return hashlib.sha256(held).hexdigest()[:32]


def thaw(names: Sequence[Name], held: Sequence[bytes]) -> Any:
    """Deserialize an object; `held` are the pieces, each once.

    Arrays keep their writable flag: it is part of their type in compiled code, so a kernel
    compiled for one does not fit the other.
    """
    pieces = dict(zip(dict.fromkeys(name for name, _ in names), held, strict=True))
    (skeleton, _), *arrays = names
    buffers = [bytearray(pieces[n]) if writable else pieces[n] for n, writable in arrays]
    return pickle.loads(pieces[skeleton], buffers=buffers)


# ------------------------------------------------------------------------- plugin files
# Plugin files (`--plugins FILE.py`), which are sent to the workers with a scene.
#
# A description may contain records of classes that such a file defines. So the files come
# first in the serialized data, and are imported when they are unpickled, before the scene.

Files = tuple[tuple[str, bytes], ...]  # paths relative to a common folder, contents


class PluginFiles:
    """The plugin files of this process; unpickling imports them on the worker."""

    def __reduce__(self) -> tuple[Callable[..., None], tuple[tuple[Files, ...]]]:
        """Return the function that a worker calls to unpickle this object."""
        return import_sent, (tuple(_contents(path) for path in plugin_file.imported),)


def _contents(path: str) -> Files:
    """Return the file first, then the files around it that it imports."""
    files = with_neighbours(path)
    folder = os.path.commonpath([file.parent for file in files])
    return tuple((f.relative_to(folder).as_posix(), f.read_bytes()) for f in files)


def import_sent(plugins: tuple[Files, ...]) -> None:
    """Write received files to a folder named by their hash, and import the first one.

    Raises
    ------
    SceneError
        If one cannot be imported, or if this process has already imported other content
        under the same name: Python would continue to use that.
    """
    have = {_contents(path) for path in plugin_file.imported}
    for files in plugins:
        if files in have:  # this process has sent or imported them already
            continue
        _refuse_stale(files)
        digest = hashlib.sha256(repr(files).encode()).hexdigest()[:16]
        folder = cache_folder("plugins") / digest
        for name, content in files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)  # other workers here may write the same file
        plugin_file.import_plugin_file(str(folder / Path(files[0][0])))


def _refuse_stale(files: Files) -> None:
    """Refuse files whose module names are loaded with different content."""
    plugin = Path(files[0][0])
    sent = cache_root() / "plugins"
    for name, content in files:
        parts = Path(os.path.relpath(name, plugin.parent)).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name == files[0][0]:
            module = plugin_file.module_name(plugin)
        loaded = getattr(sys.modules.get(module), "__file__", None)
        if loaded is None:
            continue
        # a neighbouring file with the name of a library module is not what is imported
        ours = name == files[0][0] or Path(loaded).is_relative_to(sent)
        if ours and (not os.path.isfile(loaded) or Path(loaded).read_bytes() != content):
            raise SceneError(
                f"{Path(name).name} is not what this worker has imported under that name; "
                "restart the workers"
            )


# ------------------------------------------------------------------------------- worker
# Tasks on a worker: add samples of places to the sums that come with the task.
#
# A worker keeps no state that matters. Each task contains the sums that its samples are
# added to and returns them, so a worker may be lost at any moment.

KEPT = 3  # scenes that a process keeps ready: neighbours in a sweep
MOST_THREADS = 256  # of one worker
INSTEAD = "a worker with more memory, or one with many threads in the place of several"


class Request(NamedTuple):
    """Everything that a worker needs of a render."""

    plugins: PluginFiles | None  # first, so that it is unpickled first
    description: SceneDescription
    plan: Plan
    options: RenderOptions


def request_of(job: RenderJob) -> Content:
    """Return the serialized `Request` of a render.

    Raises
    ------
    ClusterError
        If a part of it cannot be sent.
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
    film: Film  # without samples: it has the tiles and the order of samples
    threads: queue.SimpleQueue[int]  # numbers of free workspaces


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
    """Prepare this worker for a render; return how it differs from the client.

    Parameters
    ----------
    key, names, held
        The serialized `Request`, see the functions above.
    ours : dict
        Program and machine of the client.
    portion : Portion
        Samples that a differing worker renders, to prove that its bits are equal.
    expected : str
        SHA-256 of their sums.

    Raises
    ------
    ClusterError
        If this worker has another lightproof, or other bits.
    SceneError
        If it cannot read the scene, or lacks memory.
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
    """Add the samples of a portion to the sums of its places; also return the seconds.

    Parameters
    ----------
    key, names, held
        The serialized `Request`, see the functions above.
    portion : Portion
        Which samples.
    sums : float64 (places, channels + 1, rows, columns), or None
        Sums so far; None: zeros.
    """
    job, film, threads = _prepared(key, names, held)
    start = time.perf_counter()
    count = len(portion.places)
    if sums is None:
        result = np.zeros((count, *film.sums.shape[1:]))
    else:
        result = np.array(sums)  # a copy: the received array is read-only
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
    """Return a job that is ready to trace; the last few are cached."""
    with _one_prepares:
        if key not in _ready:
            request: Request = thaw(names, held)
            _ready[key] = _make_ready(request)
            while len(_ready) > KEPT:
                _ready.popitem(last=False)
        _ready.move_to_end(key)
        return _ready[key]


def _make_ready(request: Request) -> _Ready:
    """Build a job; raise NotAllowed if it needs more memory than is available."""
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
    """Return the number of threads of this worker; 1 outside of a worker."""
    from distributed import get_worker

    try:
        return int(get_worker().state.nthreads)
    except ValueError:
        return 1


def dask_setup(process: Any) -> None:
    """Ignore Ctrl-C, which a terminal sends to all processes; the client handles it.

    Dask calls it in the workers of `local:N`, which end with their cluster.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
