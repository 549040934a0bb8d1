"""How large a study of accelerators is: quick for every page, full for the numbers."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_ref.records.machine import usable_cores
from reports.accelerator_trials.meshes import (
    Maker,
    displaced_icosphere,
    soup,
    street,
    teapot,
    teapot_in_a_stadium,
)

MEMORY_LIMIT = 8 * 2**30  # [bytes] that growth may take


@dataclass(frozen=True)
class StudySettings:
    """Sizes and patience."""

    name: str
    scenes: tuple[Maker, ...]
    pixels: int  # a side of the square picture whose rays are traced
    rounds: int  # turns of each contender
    build_rounds: int
    seconds: float  # for one turn; a slow structure gets a share of the rays
    # [s] before a turn: for a while threads that have nothing to do keep looking for work
    pause: float
    map_width: int  # pixels of a heat map
    map_height: int
    frequencies: tuple[int, ...]  # of the growing ball: 20 frequency^2 triangles
    build_limit: float  # [s] structures stop growing that would build for longer
    lecture_seconds: float  # for one structure's picture of the lecture's size


# On two quiet cores about a minute, 44 s of the processor and 13 s of pauses; where kernels
# have to be compiled, another 75 s of the processor, by two processes.
QUICK = StudySettings(
    name="quick",
    scenes=(teapot, lambda: soup(10_000), teapot_in_a_stadium),
    pixels=128,
    rounds=2,
    build_rounds=2,
    seconds=0.005,
    pause=0.02,
    map_width=96,
    map_height=72,
    frequencies=(7, 22, 71),
    build_limit=1.2,
    lecture_seconds=0.1,
)
FULL = StudySettings(
    name="full",
    scenes=(
        lambda: displaced_icosphere(128),
        teapot,
        lambda: soup(100_000),
        teapot_in_a_stadium,
        lambda: street(8000),
    ),
    pixels=768,
    rounds=5,
    build_rounds=3,
    seconds=0.25,
    pause=0.05,
    map_width=160,
    map_height=120,
    frequencies=(7, 22, 71, 224, 707),
    build_limit=120.0,
    lecture_seconds=3.0,
)


def all_threads() -> int:
    """Return the threads of the fast rows of the tables: one for each core."""
    return usable_cores()


def thread_counts() -> list[int]:
    """Return the numbers of threads for parallel scaling: all up to 8, then doublings."""
    cores = all_threads()
    counts = {*range(1, min(cores, 8) + 1), cores}
    step = 16
    while step < cores:
        counts.add(step)
        step *= 2
    return sorted(counts)
