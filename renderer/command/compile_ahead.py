"""Compile every kernel of the product once, with all processors."""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Collection
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
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
from renderer.kernels.jit.cache import KERNEL_CACHE, is_kept_in
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
    workers = min(default_threads(), room() // _MOST_MEMORY, len(scenes))
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(
            max(1, workers),
            multiprocessing.get_context("spawn"),
            _begin_worker,
            max_tasks_per_child=_SCENES_EACH,
        ) as pool,
    ):
        write_files(Path(folder))
        jobs = [pool.submit(render_small, small, Path(folder)) for small in scenes]
        jobs.append(pool.submit(compile_others))
        try:
            show(0, len(jobs))
            for done, job in enumerate(as_completed(jobs), start=1):
                job.result()
                show(done, len(jobs))
        except BaseException:
            for process in multiprocessing.active_children():
                process.terminate()
            raise
    if replay and not names:
        marker.touch()
    return True


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
