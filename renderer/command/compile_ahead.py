"""Compile every kernel of the product once, with all processors."""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Collection
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory

from numba.core.registry import cpu_target

from renderer.command.every_kernel import (
    compile_others,
    render_small,
    small_scenes,
    without_replay,
    write_files,
)
from renderer.errors import SceneError
from renderer.kernels.jit.cache import KERNEL_CACHE, all_are_kept, is_kept_in
from renderer.process.memory import room
from renderer.process.worker_pool import default_threads

_MOST_MEMORY = 1 << 30  # bytes of a process, after some scenes
_SCENES_EACH = 8  # of one process, which keeps all that it has compiled


def compile_all(
    show: Callable[[int, int], None], *, replay: bool = True, names: Collection[str] = ()
) -> bool:
    """Compile all kernels into the cache; return False if an earlier call has.

    Parameters
    ----------
    show : callable
        Called with the number of scenes that are done, and of all.
    replay : bool
        Whether those of a replay are among them. They have instructions that differ from
        processor to processor in the result, so a wheel cannot carry them.
    names : collection of str
        Of scenes of `every_kernel`; empty: all.

    Raises
    ------
    SceneError
        If the cache cannot be written.
    """
    marker = _marker()
    if marker.exists():
        return False
    if not is_kept_in(KERNEL_CACHE):
        raise SceneError(f"{KERNEL_CACHE}: compiled kernels cannot be kept there")
    scenes = [
        small if replay else without_replay(small)
        for small in small_scenes()
        if not names or small.name in names
    ]
    workers = max(1, min(default_threads(), room() // _MOST_MEMORY))
    finished: SimpleQueue[BaseException | None] = SimpleQueue()
    with TemporaryDirectory() as name, ThreadPoolExecutor(workers) as threads:
        folder = Path(name)
        write_files(folder)
        tasks: list[partial[None]] = [partial(render_small, s, folder) for s in scenes]
        tasks.append(partial(compile_others))
        for k in range(0, len(tasks), _SCENES_EACH):
            threads.submit(_run_in_process, tasks[k : k + _SCENES_EACH], finished)
        try:
            for done in range(len(tasks) + 1):
                if done and (error := finished.get()) is not None:
                    raise error
                show(done, len(tasks))
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise
    if replay and not names:
        try:
            marker.touch()
        except OSError as error:
            raise SceneError(f"{marker}: {error.strerror}") from None
    return True


def _run_in_process(
    tasks: list[partial[None]], finished: SimpleQueue[BaseException | None]
) -> None:
    """Run some tasks in a process of their own; put None for each that is done.

    A pool of processes that end after some tasks (`max_tasks_per_child`) hangs in Python
    3.11 when all of them end at once.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, _begin_worker) as pool:
        try:
            for job in [pool.submit(_run_and_keep, task) for task in tasks]:
                job.result()
                finished.put(None)
        except BrokenProcessPool:
            what = "a process that compiled kernels was killed; is there enough memory?"
            finished.put(SceneError(what))
        except BaseException as error:
            finished.put(error)
            pool.shutdown(wait=False, cancel_futures=True)


def _run_and_keep(task: partial[None]) -> None:
    """Run a task; raise SceneError if one of its kernels could not be kept."""
    task()
    if not all_are_kept():
        raise SceneError(f"{KERNEL_CACHE}: compiled kernels cannot be kept there")


def _marker() -> Path:
    """Return the file that says that all kernels are there for this processor."""
    processor = str(cpu_target.target_context.codegen().magic_tuple())
    return KERNEL_CACHE / f"all-{hashlib.sha256(processor.encode()).hexdigest()[:16]}"


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits
    logging.getLogger("renderer").setLevel(logging.ERROR)  # of scenes that look odd
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when the one that waits is killed: a pool would go on for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
