"""What a cluster costs, and how far it carries: threads against workers, and simulations.

Measured on this machine: what it costs to deal out a portion, and the same picture by
threads and by local workers of one thread each, in turn. With these costs, clusters of up
to 1000 workers are simulated.
"""

from __future__ import annotations

import functools
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import numpy as np

import renderer
from renderer.rendering.cluster import portions
from renderer.rendering.cluster.connect import open_cluster
from renderer.rendering.cluster.source import ClusterWorkers
from renderer.scene.scene import Scene
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.bench.timing import median, ratio, take_turns
from reports.trials.cluster_simulation import CASES, Costs, simulate
from reports.trials.scene_files import scene_file

HERE, SIMULATED = "this machine", "simulated clusters"
SCENE = "cornell-box"
COUNTS = (1, 2, 4)
ROUND_TRIPS = 100
RATIO = "time of workers, that of threads is 1"
TRACING, DEALING = "workers trace", "client and scheduler are busy"


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the times and costs of this machine, or what is simulated with its costs."""
    side = bench.whole("size", 128 if bench.quick else 512)
    bench.show("the cost of a portion")
    costs = _costs(side)
    row = functools.partial(Row, case=case)
    if case == SIMULATED:
        for name, picture in CASES.items():
            for workers in (10, 100, 1000):
                found = simulate(picture, costs, workers)
                at = functools.partial(row, contender=name, at=float(workers))
                yield at(quantity="time", unit="s", value=found.seconds)
                yield at(quantity=TRACING, unit="%", value=100.0 * found.efficiency)
                yield at(quantity=DEALING, unit="%", value=100.0 * found.busy)
        return
    for count in COUNTS[:2] if bench.quick else COUNTS:
        yield from _against_threads(side, count, bench)
    for name, seconds in {
        "a portion, processor time": costs.portion,
        "a megabyte of sums, processor time": 1e6 * costs.byte,
        "an empty task, there and back": costs.alone,
        "start of the cluster": costs.start,
        "first portion: imports, scene, kernels": costs.first,
        "a million samples of one thread": 1e6 / costs.rate,
    }.items():
        yield row(contender=name, quantity="cost", unit="s", value=seconds)


def _against_threads(side: int, count: int, bench: Bench) -> Iterator[Row]:
    """Render the same picture by threads and by workers of one thread, in turn.

    Raises
    ------
    ValueError
        If a picture differs: then no time is worth anything.
    """
    scene, spp = _scene(side), bench.whole("spp", 32 if bench.quick else 256)
    truth = np.asarray(renderer.render(scene, spp))
    with open_cluster(f"local:{count}") as workers:
        renderer.render(scene, 8, cluster=workers)  # workers are awake, kernels loaded
        before = workers.tally.portions, _bytes(workers)

        def rendering(name: str, **ways: Any) -> Callable[[int], None]:
            def render(turn: int) -> None:
                if not np.array_equal(renderer.render(scene, spp, **ways), truth):
                    raise ValueError(f"{count} {name} render another picture")

            return render

        contenders = {
            "threads": rendering("threads", threads=count),
            "workers": rendering("workers", cluster=workers),
        }
        rounds = bench.whole("rounds", 3)
        place = f"{count} threads or workers"
        times = take_turns(
            contenders, rounds, show=lambda stage: bench.show(f"{place}: {stage}")
        )
        dealt = (workers.tally.portions - before[0]) / rounds
        sent = (_bytes(workers) - before[1]) / rounds / 1e6
    row = functools.partial(Row, case=HERE)
    for name, seconds in times.items():
        yield row(
            at=float(count),
            contender=name,
            quantity="time",
            unit="s",
            **median(seconds),
        )
    value, interval = ratio(times["workers"], times["threads"])
    several = functools.partial(row, contender=f"{count} worker{'s' * (count > 1)}")
    yield several(quantity=RATIO, unit="times", value=value, interval=interval)
    yield several(quantity="portions of a picture", value=dealt)
    yield several(quantity="sums sent and received", unit="MB", value=sent)


def _scene(side: int) -> Scene:
    return renderer.load_file(scene_file(SCENE), width=side, height=side)


@functools.cache
def _costs(side: int) -> Costs:
    """Measure with one worker: processor seconds, which other programs change less.

    Client and scheduler are threads of this process, so that its time is that of both.
    """
    scene, begin = _scene(side), time.perf_counter()
    with open_cluster("local:1") as workers:
        start = time.perf_counter() - begin
        begin = time.perf_counter()
        renderer.render(scene, 1, cluster=workers)
        first = time.perf_counter() - begin
        with mock.patch.object(portions, "MOST_BYTES", 1):  # of one place each
            few = _processor_seconds(scene, workers)
        many = _processor_seconds(scene, workers)

        def empty_task(turn: int) -> None:
            workers.client.submit(int, pure=False).result()

        alone = statistics.median(take_turns({"": empty_task}, ROUND_TRIPS)[""])
    # portion * p + byte * b = seconds, of both
    table = np.array([few[1:], many[1:]], np.float64)
    portion, byte = np.linalg.solve(table, [few[0], many[0]])
    begin = time.process_time()
    renderer.render(scene, 64, threads=1)
    rate = side * side * 64 / (time.process_time() - begin)
    return Costs(float(portion), max(float(byte), 0.0), start, first, alone, rate)


def _processor_seconds(scene: Scene, workers: ClusterWorkers) -> tuple[float, int, int]:
    """Return seconds, portions and bytes of one picture with few samples."""
    before = workers.tally.portions, _bytes(workers)
    begin = time.process_time()
    renderer.render(scene, 48, cluster=workers)
    seconds = time.process_time() - begin
    return seconds, workers.tally.portions - before[0], _bytes(workers) - before[1]


def _bytes(workers: ClusterWorkers) -> int:
    return workers.tally.bytes_sent + workers.tally.bytes_received


def verdict(table: Table) -> str:
    """Say what workers cost on this machine, and how far a large picture scales."""
    sentences = []
    for row in table.where(quantity=RATIO).rows[-1:]:
        if isinstance(row.value, float):
            times = f"{row.value:.3g} times as long as {row.contender.split()[0]} threads"
            sentences.append(f"On this machine {row.contender} take {times}.")
    large = table.where(quantity=TRACING, contender=list(CASES)[1])
    scales = [
        f"{row.value:.0f} % with {row.at:g} workers"
        for row in large.rows[1:]
        if isinstance(row.value, float)
    ]
    if scales:
        sentences.append(f"Of the time of a large picture, tracing is {', '.join(scales)}.")
    return " ".join(sentences)


STUDY = Study(
    title="Clusters",
    sentence="What does it cost to deal out a picture to other processes, and up to how "
    "many workers does that pay?",
    advice="Give pictures of many minutes to a cluster (`--cluster`), others to the "
    "threads of one machine.",
    minutes=2,
    quick_minutes=0.7,
    cases=(HERE, SIMULATED),
    axis="threads or workers",
    options={
        "size": "pixels of a side (512)",
        "spp": "samples of the measured picture (256)",
        "rounds": "turns of threads and workers (3)",
    },
    measure=measure,
    verdict=verdict,
)
