"""The record scaling.json: what was measured of clusters, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass, field

from reports.records.circumstances import Circumstances


@dataclass(frozen=True)
class Costs:
    """What it costs to deal out work, in processor seconds of client and scheduler."""

    portion: float  # [s] each
    byte: float  # [s] of sums, there and back
    alone: float  # [s] for one portion with nothing in it, from asking to having
    start: float  # [s] until a new cluster of one worker could be given work
    first: float  # [s] more until that worker's first portion was back
    rate: float  # samples per second of one thread


@dataclass(frozen=True)
class Run:
    """One render of the same picture, without the start of the cluster."""

    by: str  # "threads" or "workers"
    count: int
    seconds: list[float]
    portions: int = 0
    megabytes: float = 0.0  # sent and received


@dataclass(frozen=True)
class Simulated:
    """One simulated render."""

    case: str
    workers: int
    seconds: float
    efficiency: float  # of the workers' time that is tracing
    busy: float  # part of the time that client and scheduler are busy


@dataclass(frozen=True, kw_only=True)
class Scaling(Circumstances):
    """All of it."""

    scene: str = ""
    samples: int = 0  # of the picture that was measured
    costs: Costs | None = None
    runs: list[Run] = field(default_factory=list)
    simulated: list[Simulated] = field(default_factory=list)
