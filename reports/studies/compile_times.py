"""How long kernels take to compile: the first pictures of nine scenes in one process.

Processor seconds, of all threads, from an empty cache on. What one scene compiled the next
ones find, so the sum is what counts, and each number depends on the scenes before it.
"""

from __future__ import annotations

from collections.abc import Iterator

from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.trials.first_pictures import compile_seconds

FORMER = {
    "cornell-box": 13.7,
    "colour-bleeding": 10.9,
    "caustic": 8.8,
    "metals": 28.3,
    "smooth-mesh": 7.0,
    "textured-room": 10.0,
    "analytic-shapes": 8.9,
    "instances": 20.8,
    "emitters": 10.6,
}
"""Scenes in their order, and what each took in an earlier version, 119 s in all [s]."""

SUM = "all"
NOW, THEN = "processor time", "earlier version"


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the processor seconds of each scene's first picture, and their sum."""
    scenes = tuple(FORMER)[:2] if bench.quick else tuple(FORMER)
    found = dict(compile_seconds(scenes, bench.show))
    former = {scene: FORMER[scene] for scene in found}
    for quantity, times in ((NOW, found), (THEN, former)):
        for scene, seconds in {**times, SUM: sum(times.values())}.items():
            yield Row(
                case=case, contender=scene, quantity=quantity, value=seconds, unit="s"
            )


def verdict(table: Table) -> str:
    """Say how long all scenes take together."""
    now, then = (table.value(quantity=quantity, contender=SUM) for quantity in (NOW, THEN))
    if not now:
        return ""
    count = len(table.where(quantity=NOW)) - 1
    return (
        f"The kernels of {count} scenes compile in {now:.3g} s of one core, instead of "
        f"{then:.3g} s in an earlier version; the next start finds them in the cache."
    )


STUDY = described(
    "compile-times",
    cases=("first pictures",),
    measure=measure,
    verdict=verdict,
)
