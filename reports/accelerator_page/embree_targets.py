"""What the fastest structure was to reach beside Embree, and whether it did."""

from __future__ import annotations

import math
import statistics

from reports.accelerator_page.scene_tables import SceneSection, median_speed
from reports.accelerator_study.record import (
    AcceleratorStudy,
    PeerRow,
    StructureRow,
    StudyScene,
    Times,
)
from reports.accelerator_trials import peers
from reports.page.formatting import number
from reports.speed.section import Target

SCENES = ("icosphere", "teapot")  # those that the targets speak of
INCOHERENT = ("diffuse", "random")
BESIDE_MITSUBA = {"camera": 1.2, "diffuse": 1.0, "random": 1.0}
BESIDE_EMBREEX = {"diffuse": 1.2, "random": 1.2}
ANY_HIT = 1.3
AUTO = 1.15


def judged_structure(study: AcceleratorStudy) -> str:
    """Return the structure with the most incoherent rays per second on the first scene."""
    speeds = {}
    for row in study.scenes[0].structures:
        each = [median_speed(row.nanoseconds, kind, study.threads) for kind in INCOHERENT]
        if None not in each:
            speeds[row.name] = math.prod(speed for speed in each if speed)
    return max(speeds, key=speeds.__getitem__, default="")


def embree_targets(
    study: AcceleratorStudy, sections: tuple[SceneSection, ...]
) -> tuple[Target, ...]:
    """Return every target with what was measured; a ratio is the median of the rounds."""
    name = judged_structure(study)
    targets = []
    for scene in study.scenes:
        ours = next((row for row in scene.structures if row.name == name), None)
        if scene.name not in SCENES or ours is None:
            continue
        for kind, wanted in BESIDE_MITSUBA.items():
            targets.append(_beside(scene, ours, peers.MITSUBA, kind, study.threads, wanted))
        for kind, wanted in BESIDE_EMBREEX.items():
            targets.append(_beside(scene, ours, peers.EMBREEX, kind, 1, wanted))
        targets.append(_build(scene, ours))
        targets.append(_any_hit(scene, ours, study.threads))
    targets += [_auto(sections), _memory(study)]
    return tuple(targets)


def _times(value: float) -> str:
    return f"{number(value)} times"


def _target(what: str, wanted: float, measured: float | None) -> Target:
    if measured is None:
        return Target(what, f"at least {_times(wanted)}", "not measured", None)
    return Target(what, f"at least {_times(wanted)}", _times(measured), measured >= wanted)


def pair_ratio(theirs: Times, ours: Times, kind: str, threads: int) -> float | None:
    """Return how many times as fast ours is: the median over the rounds, pair by pair."""
    both = zip(
        theirs.get(kind, {}).get(threads, ()),
        ours.get(kind, {}).get(threads, ()),
        strict=False,
    )
    ratios = [their / our for their, our in both]
    return statistics.median(ratios) if ratios else None


def _peer(scene: StudyScene, name: str) -> PeerRow | None:
    return next((row for row in scene.peers if row.name == name), None)


def _beside(
    scene: StudyScene, ours: StructureRow, name: str, kind: str, threads: int, wanted: float
) -> Target:
    peer = _peer(scene, name)
    ratio = pair_ratio(peer.nanoseconds, ours.nanoseconds, kind, threads) if peer else None
    plural = "s" if threads != 1 else ""
    what = f"{scene.title}: {kind} rays beside {name}, {threads} thread{plural} each"
    return _target(what, wanted, ratio)


def _build(scene: StudyScene, ours: StructureRow) -> Target:
    peer = _peer(scene, peers.MITSUBA)
    ratio = None
    if peer and peer.build_seconds and ours.build_seconds:
        ratio = min(peer.build_seconds) / min(ours.build_seconds)
    return _target(f"{scene.title}: speed of the build beside {peers.MITSUBA}", 1.0, ratio)


def _any_hit(scene: StudyScene, ours: StructureRow, threads: int) -> Target:
    any_hit = median_speed(ours.nanoseconds, "shadow", threads)
    nearest = median_speed(ours.nanoseconds, "shadow_nearest", threads)
    ratio = any_hit / nearest if any_hit and nearest else None
    what = f"{scene.title}: any hit beside nearest hit, the same shadow rays"
    return _target(what, ANY_HIT, ratio)


def _auto(sections: tuple[SceneSection, ...]) -> Target:
    what = (
        "--accel auto: build and trace beside the best structure, worst case of all scenes"
    )
    wanted = f"at most {_times(AUTO)} as long"
    ratios = [total.ratio for section in sections for total in section.totals]
    known = [ratio for ratio in ratios if ratio is not None]
    if not known or len(known) < len(ratios):
        return Target(what, wanted, "not measured", None)
    return Target(what, wanted, f"{_times(max(known))} as long", max(known) <= AUTO)


def _memory(study: AcceleratorStudy) -> Target:
    growth = study.growth
    sizes = [point.triangles for one in growth.series for point in one.points]
    what = f"memory of the whole study, up to {max(sizes, default=0):,} triangles"
    gib = 2**30
    if growth.peak_bytes == 0:  # this system does not say
        return Target(
            what, f"at most {growth.memory_limit / gib:g} GiB", "not measured", None
        )
    return Target(
        what,
        f"at most {growth.memory_limit / gib:g} GiB",
        f"{number(growth.peak_bytes / gib)} GiB",
        growth.peak_bytes <= growth.memory_limit,
    )
