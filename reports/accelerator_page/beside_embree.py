"""How many times as fast the fastest structure is as Embree, in the same run."""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass

from reports.accelerator_page.scene_tables import SHOWN, median_speed
from reports.accelerator_study.record import (
    AcceleratorStudy,
    PeerRow,
    StructureRow,
    StudyScene,
    Times,
)
from reports.accelerator_trials.peers import EMBREEX

INCOHERENT = ("diffuse", "random")


@dataclass(frozen=True)
class Ratios:
    """One peer on one scene; None: not measured."""

    scene: str
    peer: str
    threads: int  # of both
    build: float | None
    rays: dict[str, float | None]  # by kind, the median of the rounds


def judged_structure(study: AcceleratorStudy) -> str:
    """Return the structure with the most incoherent rays per second on the first scene."""
    speeds = {}
    for row in study.scenes[0].structures:
        each = [median_speed(row.nanoseconds, kind, study.threads) for kind in INCOHERENT]
        if None not in each:
            speeds[row.name] = math.prod(speed for speed in each if speed)
    return max(speeds, key=speeds.__getitem__, default="")


def beside_embree(study: AcceleratorStudy) -> tuple[Ratios, ...]:
    """Return how the judged structure does beside every peer on every scene."""
    name = judged_structure(study)
    return tuple(
        _ratios(scene, peer, ours, 1 if peer.name == EMBREEX else study.threads)
        for scene in study.scenes
        for ours in scene.structures
        if ours.name == name
        for peer in scene.peers
    )


def any_hit_ratio(study: AcceleratorStudy) -> float | None:
    """Return how many times as fast any hit is as the nearest on the same shadow rays."""
    name, threads = judged_structure(study), study.threads
    for row in study.scenes[0].structures:
        if row.name == name:
            any_hit = median_speed(row.nanoseconds, "shadow", threads)
            nearest = median_speed(row.nanoseconds, "shadow_nearest", threads)
            return any_hit / nearest if any_hit and nearest else None
    return None


def _ratios(scene: StudyScene, peer: PeerRow, ours: StructureRow, threads: int) -> Ratios:
    build = None
    if peer.build_seconds and ours.build_seconds:
        build = min(peer.build_seconds) / min(ours.build_seconds)
    rays = {
        kind: _pair_ratio(peer.nanoseconds, ours.nanoseconds, kind, threads)
        for kind in SHOWN
    }
    return Ratios(scene.title, peer.name, threads, build, rays)


def _pair_ratio(theirs: Times, ours: Times, kind: str, threads: int) -> float | None:
    """Form ratios within each round, so that a busy moment meets both."""
    rounds = (times.get(kind, {}).get(threads, ()) for times in (theirs, ours))
    ratios = [their / our for their, our in zip(*rounds, strict=False)]
    return statistics.median(ratios) if ratios else None
