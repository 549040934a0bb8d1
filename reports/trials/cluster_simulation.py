"""A cluster of many workers, event by event, with measured costs and stated latencies.

One server, client and scheduler together, deals out portions and takes them in, one after
the other; each takes its processor time and that of its bytes. A worker has one portion at
hand and one that waits. Portions are as large as `Portions.fair_share` makes them. Not in
it: workers that fail, other users of the network, and tiles that cost more than others.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

from renderer.rendering.cluster import portions

PART = 16  # samples that a place gets first
WAITING = 2  # portions at a worker: one under way, one that waits


class Costs(NamedTuple):
    """What it costs to deal out work, in processor seconds of client and scheduler."""

    portion: float  # [s] each
    byte: float  # [s] of sums, there and back
    start: float  # [s] until a new cluster of one worker could be given work
    first: float  # [s] more until that worker's first portion was back
    alone: float  # [s] for a task with nothing in it, from request to answer
    rate: float  # samples per second of one thread


class Simulated(NamedTuple):
    """One simulated render."""

    seconds: float
    efficiency: float  # of the workers' time that is tracing
    busy: float  # part of the time that client and scheduler are busy


class Case(NamedTuple):
    """A picture and a network."""

    places: int
    place_bytes: int  # of sums
    spp: int
    slowdown: float = 1.0  # of a sample, compared with the scene that was measured
    scene_bytes: float = 1e6
    build: float = 1.0  # [s] that a worker takes to build the scene
    latency: float = 5e-4  # [s] one way
    bandwidth: float = 1.25e8  # [bytes/s] of client and scheduler
    pieces: bool = False  # the scene is passed on while it comes in; today it is not


_LARGE = Case(8160, 46_208, 4096, slowdown=10.0, scene_bytes=1e9, build=20.0)
CASES = {
    "1920 x 1080, 256 spp": Case(2040, 46_208, 256),
    "4K, 4096 dear spp, 1 GB of scene": _LARGE,
    "the same, the scene is there": _LARGE._replace(scene_bytes=0, build=0),
    "the same, 50 ms away, 100 Mbit/s": _LARGE._replace(latency=0.05, bandwidth=1.25e7),
    "the same, scene passed on in pieces": _LARGE._replace(pieces=True),
}


def simulate(case: Case, costs: Costs, workers: int) -> Simulated:
    """Return how long a picture takes, and how much of that time is work."""
    pixels = 1024
    rate = costs.rate / case.slowdown
    first = min(PART, case.spp)
    # [places, samples of each pixel]: a first part of all, then the rest
    waiting = [[float(case.places), first], [float(case.places), case.spp - first]]
    missing = float(case.places * case.spp * pixels)
    every_sample = missing / rate
    transfer = case.scene_bytes / case.bandwidth
    # it goes from worker to worker, doubling each time; in pieces, all links are at work
    passes = 1.0 if case.pieces else float(workers.bit_length())
    ready = costs.start + costs.first + transfer * passes + case.build
    free = ready  # when the server is
    busy = 0.0
    worker_free = [ready] * workers
    # (when the server hears of it, worker, samples that came back, bytes)
    events = [(ready, number, 0.0, 0) for number in range(workers) for _ in range(WAITING)]
    heapq.heapify(events)
    end = ready
    while events:
        heard, number, came, size = heapq.heappop(events)
        missing -= came
        samples, size_next = 0.0, 0
        share = rate * portions.portion_seconds(max(missing, 0) / rate, workers)
        while waiting and samples < share:
            places, spp = waiting[0]
            if places <= 0.0 or spp == 0:
                waiting.pop(0)
                continue
            # of a place that is too much for one portion a part, of 16 samples at least
            wanted = (share - samples) / (spp * pixels)
            taken = min(places, max(wanted, min(1.0, PART / spp)))
            waiting[0][0] -= taken
            samples += taken * spp * pixels
            size_next += math.ceil(taken) * case.place_bytes
            if size_next > portions.MOST_BYTES:
                break
        cost = (costs.portion if came or samples else 0.0) + size * costs.byte
        cost = max(cost, size / case.bandwidth)
        start = max(heard, free)
        free = start + cost
        busy += cost
        if came:
            end = max(end, free)
        if samples:
            arrives = free + case.latency + size_next / case.bandwidth
            done = max(arrives, worker_free[number]) + samples / rate
            worker_free[number] = done
            back = (done + case.latency, number, samples, 2 * size_next)
            heapq.heappush(events, back)
    return Simulated(end, every_sample / (workers * end), busy / end)
