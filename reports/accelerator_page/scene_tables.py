"""From one study scene's times to its tables: speed, work per ray, total time."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from reports.accelerator_study.record import (
    AcceleratorStudy,
    PeerRow,
    StructureRow,
    StudyScene,
    Times,
)
from reports.charts.rows import dots_chart

SHOWN = ("camera", "shadow", "diffuse", "random")
# A picture's rays are thought of as one third each of these.
WORKLOAD = ("camera", "shadow", "diffuse")


@dataclass(frozen=True)
class SpeedRow:
    """One contender in the table of speeds."""

    name: str
    is_peer: bool
    fault: str
    build_seconds: float | None  # the fastest round
    mebibytes: float | None
    one: dict[str, float]  # million rays/s by kind, one thread, median of the rounds
    all: dict[str, float]  # the same with all threads
    share: float | None  # of the camera rays that were traced; None: all
    agreement: float | None  # a peer's least share of rays with our primitive


@dataclass(frozen=True)
class TotalRow:
    """Build and trace together, for so many rays."""

    rays: int
    best: str
    best_seconds: float
    auto: str
    auto_seconds: float | None

    @property
    def ratio(self) -> float | None:
        """How much longer `auto` takes than the best."""
        return None if self.auto_seconds is None else self.auto_seconds / self.best_seconds


@dataclass(frozen=True)
class SceneSection:
    """One scene, ready to be drawn."""

    scene: StudyScene
    anchor: str
    speeds: tuple[SpeedRow, ...]
    totals: tuple[TotalRow, ...]
    chart: Markup | None


def median_speed(times: Times, kind: str, threads: int) -> float | None:
    """Return million rays per second, the median of the rounds; None: not measured."""
    rounds = times.get(kind, {}).get(threads)
    return None if not rounds else 1e3 / statistics.median(rounds)


def scene_section(scene: StudyScene, study: AcceleratorStudy) -> SceneSection:
    """Work out what the page shows of one scene."""
    speeds = tuple(
        [_structure_row(row, scene, study.threads) for row in scene.structures]
        + [_peer_row(row, study.threads) for row in scene.peers]
    )
    return SceneSection(
        scene=scene,
        anchor=f"scene-{scene.name}",
        speeds=speeds,
        totals=tuple(_total(rays, auto, scene, study) for rays, auto in scene.auto.items()),
        chart=_chart(scene, study, speeds),
    )


def _speeds(times: Times, threads: int) -> dict[str, float]:
    found = {kind: median_speed(times, kind, threads) for kind in SHOWN}
    return {kind: speed for kind, speed in found.items() if speed is not None}


def _structure_row(row: StructureRow, scene: StudyScene, threads: int) -> SpeedRow:
    traced, there = row.rays.get("camera", 0), scene.rays.get("camera", 0)
    return SpeedRow(
        name=row.name,
        is_peer=False,
        fault=row.fault,
        build_seconds=min(row.build_seconds, default=None),
        mebibytes=row.bytes / 2**20,
        one=_speeds(row.nanoseconds, 1),
        all=_speeds(row.nanoseconds, threads),
        share=traced / there if 0 < traced < there else None,
        agreement=None,
    )


def _peer_row(row: PeerRow, threads: int) -> SpeedRow:
    found = (one.same_primitive for one in row.agreement.values())
    shares = [share for share in found if share is not None]
    return SpeedRow(
        name=row.name,
        is_peer=True,
        fault=row.fault,
        build_seconds=min(row.build_seconds, default=None),
        mebibytes=None,
        one=_speeds(row.nanoseconds, 1),
        all=_speeds(row.nanoseconds, threads),
        share=None,
        agreement=min(shares, default=None),
    )


# ---------------------------------------------------------------------------- totals


def total_seconds(row: StructureRow, rays: int, threads: int) -> float | None:
    """Return seconds to build and to trace `rays`, a third of each kind of `WORKLOAD`."""
    speeds = [median_speed(row.nanoseconds, kind, threads) for kind in WORKLOAD]
    if not row.build_seconds or None in speeds:
        return None
    each = sum(1e-6 / speed for speed in speeds if speed) / len(WORKLOAD)
    return statistics.median(row.build_seconds) + rays * each


def _total(rays: int, auto: str, scene: StudyScene, study: AcceleratorStudy) -> TotalRow:
    totals: Mapping[str, float] = {
        row.name: seconds
        for row in scene.structures
        if (seconds := total_seconds(row, rays, study.threads)) is not None
    }
    if not totals:
        return TotalRow(rays, "", 0.0, auto, None)
    best = min(totals, key=totals.__getitem__)
    return TotalRow(rays, best, totals[best], auto, totals.get(auto))


# ----------------------------------------------------------------------------- chart


def _chart(
    scene: StudyScene, study: AcceleratorStudy, speeds: tuple[SpeedRow, ...]
) -> Markup | None:
    titles = {kind.name: kind.title for kind in study.kinds}
    rows = [
        (row.name, {titles.get(k, k): v for k, v in (row.all or row.one).items()})
        for row in speeds
        if row.all or row.one
    ]
    if not rows:
        return None
    threads = f"{study.threads} thread{'s' if study.threads != 1 else ''}"
    return dots_chart(
        rows,
        [titles.get(kind, kind) for kind in SHOWN],
        x_label="million rays per second",
        description=f"Rays per second of every structure on {scene.title}, {threads}.",
    )
