"""peers.json as records: pictures and rays of several scenes, ours and those of others."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from pathlib import Path

from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json
from reports.speed.record import MeanCheck, Renderer

SCHEMA = 1
FILE = "peers.json"


@dataclass(frozen=True)
class PictureTimes:
    """One picture: seconds of each renderer, one number a round."""

    name: str
    width: int
    height: int
    spp: int
    check: MeanCheck
    renderers: tuple[Renderer, ...]  # ours first


@dataclass(frozen=True)
class RayTimes:
    """Rays of one kind through one mesh: nanoseconds a ray, one number a round."""

    mesh: str
    triangles: int
    kind: str
    threads: int
    rays: int
    tests: float  # of boxes and triangles, a ray of ours
    nanoseconds: dict[str, tuple[float, ...]]  # ours first
    faults: dict[str, str]  # peer -> why it was not timed


@dataclass(frozen=True, kw_only=True)
class PeersRecord(Circumstances):
    """A whole peers.json."""

    threads: int  # of each renderer, for pictures
    pictures: tuple[PictureTimes, ...]
    rays: tuple[RayTimes, ...]


def read_peers(path: Path) -> PeersRecord:
    """Read and check peers.json; raise ReportError for what is wrong, and where."""
    return read_json(path, PeersRecord, SCHEMA)


def ratio(theirs: tuple[float, ...], ours: tuple[float, ...]) -> float:
    """Return how many times as long the other took: the median over the rounds."""
    return statistics.median(a / b for a, b in zip(theirs, ours, strict=True))
