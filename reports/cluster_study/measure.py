"""Costs of dealing out, and the same picture by threads and by workers, in turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from unittest import mock

import numpy as np

import renderer
from renderer.rendering.cluster import portions
from renderer.rendering.cluster.connect import open_cluster
from renderer.rendering.cluster.source import ClusterWorkers
from renderer.scene.scene import Scene
from reports.cluster_study.record import Costs, Run
from reports.errors import ReportError

ROUND_TRIPS = 100


def measure_costs(scene: Scene) -> Costs:
    """Measure with one worker: processor seconds, which other programs change less.

    Client and scheduler are threads of this process, so that its time is that of both.
    """
    begin = time.perf_counter()
    with open_cluster("local:1") as workers:
        start = time.perf_counter() - begin
        begin = time.perf_counter()
        renderer.render(scene, 1, cluster=workers)
        first = time.perf_counter() - begin
        with mock.patch.object(portions, "MOST_BYTES", 1):  # of one place each
            few = _processor_seconds(scene, workers)
        many = _processor_seconds(scene, workers)
        alone = _round_trip(workers)
    # portion * p + byte * b = seconds, of both
    table = np.array([few[1:], many[1:]], np.float64)
    portion, byte = np.linalg.solve(table, [few[0], many[0]])
    begin = time.process_time()
    image = renderer.render(scene, 64, threads=1)
    rate = image.width * image.height * 64 / (time.process_time() - begin)
    return Costs(float(portion), max(float(byte), 0.0), alone, start, first, rate)


def _processor_seconds(scene: Scene, workers: ClusterWorkers) -> tuple[float, int, int]:
    """Return seconds, portions and bytes of one picture with few samples."""
    tally = workers.tally
    before = (tally.portions, tally.bytes_sent + tally.bytes_received)
    begin = time.process_time()
    renderer.render(scene, 48, cluster=workers)
    seconds = time.process_time() - begin
    sent = tally.bytes_sent + tally.bytes_received
    return seconds, tally.portions - before[0], sent - before[1]


def _round_trip(workers: ClusterWorkers) -> float:
    """Return the median seconds of the smallest task there is."""
    seconds = []
    for _ in range(ROUND_TRIPS):
        begin = time.perf_counter()
        workers.client.submit(int, pure=False).result()
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def measure_runs(
    scene: Scene, spp: int, counts: list[int], repeats: int, say: Callable[[str], None]
) -> list[Run]:
    """Render the same picture by threads and by workers of one thread, in turn.

    Raises
    ------
    ReportError
        If a picture differs: then no time is worth anything.
    """
    truth = np.asarray(renderer.render(scene, spp))
    runs = []
    for count in counts:
        with open_cluster(f"local:{count}") as workers:
            renderer.render(scene, 8, cluster=workers)  # workers are awake, kernels loaded
            before = (workers.tally.portions, _megabytes(workers))
            found: dict[str, list[float]] = {"threads": [], "workers": []}
            for turn in range(repeats):
                say(f"{count} threads, {count} workers: turn {turn + 1} of {repeats}")
                ways: dict[str, dict[str, Any]] = {
                    "threads": {"threads": count},
                    "workers": {"cluster": workers},
                }
                for way, options in ways.items():
                    begin = time.perf_counter()
                    picture = np.asarray(renderer.render(scene, spp, **options))
                    found[way].append(time.perf_counter() - begin)
                    if not np.array_equal(picture, truth):
                        raise ReportError(f"{count} {way} render another picture")
            portions = (workers.tally.portions - before[0]) // repeats
            megabytes = (_megabytes(workers) - before[1]) / repeats
        runs.append(Run("threads", count, found["threads"]))
        runs.append(Run("workers", count, found["workers"], portions, megabytes))
    return runs


def _megabytes(workers: ClusterWorkers) -> float:
    return (workers.tally.bytes_sent + workers.tally.bytes_received) / 1e6
