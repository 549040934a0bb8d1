"""Stages: where the time of a path-traced picture goes, stage by stage, on one thread.

The stages of `follow_paths` are called one by one over the batches of a render, each with
its own clock. A batch has the rays of as many samples as in a render. With `--quick` every
third tile is rendered.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import renderer
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.look.formatting import number
from reports.studies.speed_accuracy import opened_scene, parameters_of
from reports.trials.architecture_scenes import ARCHITECTURE
from reports.trials.stage_times import STAGES, stage_times

SIDE = 320  # pixels of the longer side


def cases() -> list[str]:
    """Return the generated scenes of architecture size, and some small ones."""
    return [*ARCHITECTURE, "cornell-box", "textured-room", "metals"]


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the share of each stage, and nanoseconds a ray."""
    spp = bench.whole("spp", 16)
    with opened_scene(case) as path:
        scene = renderer.load_file(path, **parameters_of(path, SIDE))
        bench.show(f"{spp} samples, stage by stage")
        times = stage_times(scene, spp, every=3 if bench.quick else 1)
    total = sum(times.seconds.values())
    for stage in STAGES:
        seconds = times.seconds.get(stage, 0.0)
        one: dict[str, Any] = {"case": case, "contender": stage}
        share = round(100.0 * seconds / total, 1)
        yield Row(quantity="share of the time", value=share, unit="%", **one)
        if rays := times.rays.get(stage, 0):
            each = round(1e9 * seconds / rays, 1)
            yield Row(quantity="time of a ray or point", value=each, unit="ns", **one)
    for bounce, (seconds, rays, batches) in enumerate(times.by_bounce):
        one = {"case": case, "at": float(bounce)}
        filled = round(rays / batches, 1)
        yield Row(quantity="rays of a batch", value=filled, **one)
        each = round(1e9 * seconds / rays, 1)
        yield Row(quantity="time of a ray in all stages", value=each, unit="ns", **one)


def verdict(table: Table) -> str:
    """Return which stages take most of the time, and in how many scenes."""
    shares = table.where(quantity="share of the time")
    largest: dict[str, list[float]] = {}
    for case in shares.distinct("case"):
        most = max(shares.where(case=case), key=lambda row: float(row.value or 0.0))
        largest.setdefault(most.contender, []).append(float(most.value or 0.0))
    count = len(shares.distinct("case"))
    words = (
        f"{stage} in {len(found)} of {count} scenes (up to {number(max(found))} %)"
        for stage, found in largest.items()
    )
    return f"The stage that takes most of the time: {'; '.join(words)}." if largest else ""


STUDY = described(
    "stages",
    cases=cases,
    quick_cases=("kitchen", "cornell-box"),
    any_case=True,
    measure=measure,
    verdict=verdict,
)
