"""Our kernels for many scenes, compiled in processes side by side before anything is timed.

Numba compiles on one core and keeps the result on disk, where the process that measures
finds it. A stamp in the kernel cache says what was compiled, so that a second run starts
no process at all.
"""

from __future__ import annotations

import hashlib
import json
import queue
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from mitsuba_ref.our_renderer import picture
from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import TIME_LIMIT, RenderRequest
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.json_process import Answerer, JsonProcess, answer_requests
from renderer.errors import SceneError
from renderer.kernels.jit import KERNEL_CACHE, with_neighbours

MODULE = "mitsuba_ref.command.compile_ahead"
"""What a worker runs."""

MOST_WORKERS = 4  # each compiler takes half a gigabyte


def kernel_requests(scenes: Iterable[Path], options: Options) -> list[RenderRequest]:
    """Return the smallest renders that need the kernels of `scenes`, without those done.

    Parameters
    ----------
    scenes
        Scene files; one that cannot be read is left to its own comparison.
    options
        The settings of both renderers.
    """
    requests = []
    for path in scenes:
        try:
            request = scene_request(path, read_proof(path), options)
        except SceneError:
            continue
        # One sample: a kernel depends on kinds of things, not on their number.
        once = replace(request, spp=1, threads=1)
        requests += [once, replace(once, kind="aovs", spp=None)]
    return [request for request in requests if not _stamp(request).exists()]


def compile_kernels(
    requests: list[RenderRequest], progress: Callable[[int], None] = lambda done: None
) -> None:
    """Compile what `requests` need; whatever fails here will say so when it is rendered.

    Parameters
    ----------
    requests
        From `kernel_requests`.
    progress
        Told how many are done.
    """
    waiting: queue.SimpleQueue[RenderRequest] = queue.SimpleQueue()
    for request in requests:
        waiting.put(request)
    done: queue.SimpleQueue[bool] = queue.SimpleQueue()
    workers: list[JsonProcess] = []

    def work() -> None:
        # a dead process, or one that the end of this function has closed
        with suppress(queue.Empty, MitsubaError, OSError, ValueError):
            worker = JsonProcess(MODULE, {}, name="compiler", time_limit=TIME_LIMIT)
            workers.append(worker)
            while True:
                worker.ask(asdict(waiting.get_nowait()))
                done.put(True)

    count = min(usable_cores(), MOST_WORKERS, len(requests))
    threads = [threading.Thread(target=work, daemon=True) for _ in range(count)]
    try:
        for thread in threads:
            thread.start()
        finished = 0
        while True:
            # tested before the queue, so that no result arrives between the two tests
            working = any(thread.is_alive() for thread in threads)
            try:
                done.get(timeout=0.1 if working else 0)
            except queue.Empty:
                if not working:
                    break
                continue
            finished += 1
            progress(finished)
    finally:
        with suppress(queue.Empty):
            while True:  # Ctrl-C: nothing more is begun
                waiting.get_nowait()
        for worker in workers:
            worker.close()


def _stamp(request: RenderRequest) -> Path:
    digest = hashlib.sha256(json.dumps(asdict(request), sort_keys=True).encode())
    plugins = with_neighbours(request.plugins) if request.plugins else []
    for file in (Path(request.path), *plugins):
        digest.update(file.read_bytes())
    digest.update(Path(picture.__file__).read_bytes())
    return KERNEL_CACHE / "warm" / digest.hexdigest()[:32]


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Return what compiles for each request, and says whether it could."""

    def compile_for(wanted: dict[str, Any]) -> dict[str, Any]:
        request = RenderRequest(**wanted)
        # its own comparison will say what is wrong with a scene
        with suppress(Exception):
            # A noisy scene is rendered with the box and, once more, with its own filter.
            for box_filter in {request.box_filter, False}:
                picture.render_ours(replace(request, box_filter=box_filter))
            _stamp(request).parent.mkdir(parents=True, exist_ok=True)
            _stamp(request).touch()
        return {}

    return {}, compile_for


if __name__ == "__main__":
    answer_requests(load)
