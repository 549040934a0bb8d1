"""Our kernels for many scenes, compiled in processes side by side before anything is timed.

Numba compiles on one core and keeps the result on disk, where the process that measures
finds it. A stamp in the kernel cache says what was compiled, so that a second run starts
no process at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import RenderRequest
from renderer.errors import SceneError
from renderer.kernels.jit import KERNEL_CACHE, with_neighbours

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
    count = min(usable_cores(), MOST_WORKERS, len(requests))
    workers = [_start() for _ in range(count)]
    threads = [
        threading.Thread(target=_feed, args=(worker, waiting, done), daemon=True)
        for worker in workers
    ]
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
        for worker in workers:
            worker.kill()
            worker.wait()
        for thread in threads:
            thread.join()


def _start() -> subprocess.Popen[str]:
    root = str(Path(__file__).parents[2])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.Popen(
        [sys.executable, "-m", "mitsuba_ref.our_renderer.compile_ahead"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        start_new_session=True,  # Ctrl-C is for the harness, which then ends the workers
    )


def _feed(
    worker: subprocess.Popen[str],
    waiting: queue.SimpleQueue[RenderRequest],
    done: queue.SimpleQueue[bool],
) -> None:
    """Send the worker one request after the other until all are done or it has ended."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    # Closing a pipe to a dead process fails as writing to it does: outside of both.
    with suppress(queue.Empty, BrokenPipeError), worker.stdin, worker.stdout:
        while True:
            request = waiting.get_nowait()
            print(json.dumps(asdict(request)), file=worker.stdin, flush=True)
            if not worker.stdout.readline():
                return
            done.put(True)


def _stamp(request: RenderRequest) -> Path:
    digest = hashlib.sha256(json.dumps(asdict(request), sort_keys=True).encode())
    plugins = with_neighbours(request.plugins) if request.plugins else []
    for file in (Path(request.path), *plugins):
        digest.update(file.read_bytes())
    digest.update(Path(__file__).with_name("picture.py").read_bytes())
    return KERNEL_CACHE / "warm" / digest.hexdigest()[:32]


def serve() -> None:
    """Compile for each request of standard input, answer "true" or "false"."""
    from mitsuba_ref.our_renderer.picture import render_ours

    output = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin:
        request = RenderRequest(**json.loads(line))
        try:
            # A noisy scene is rendered with the box and, once more, with its own filter.
            for box_filter in {request.box_filter, False}:
                render_ours(replace(request, box_filter=box_filter))
            _stamp(request).parent.mkdir(parents=True, exist_ok=True)
            _stamp(request).touch()
            compiled = True
        except Exception:  # its own comparison will say what is wrong with the scene
            compiled = False
        print(json.dumps(compiled), file=output, flush=True)


if __name__ == "__main__":
    serve()
