"""benchmark.json as records: how long each renderer took, in turn, and on what."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json

SCHEMA = 1


@dataclass(frozen=True)
class Renderer:
    """One renderer's repeats; `unavailable` says why there are none."""

    name: str
    seconds: tuple[float, ...] = ()  # one a round, in the order of the rounds
    unavailable: str = ""


@dataclass(frozen=True)
class MeanCheck:
    """The image means of both renderers over some seeds, before anything is timed."""

    passed: bool
    seeds: int
    spp: int
    z: tuple[float, ...]  # per channel: difference of the means in standard errors
    limit: float
    ours_mean: tuple[float, ...]
    reference_mean: tuple[float, ...]


@dataclass(frozen=True)
class Starts:
    """Wall-clock seconds of whole `python -m renderer` processes at 1 sample per pixel."""

    warm: tuple[float, ...] = ()
    cold: tuple[float, ...] = ()
    command: str = ""


@dataclass(frozen=True, kw_only=True)
class Benchmark(Circumstances):
    """A whole benchmark.json."""

    scene: dict[str, Any]
    width: int
    height: int
    spp: int
    workers: int
    rays_per_path: float | None = None
    check: MeanCheck
    renderers: Annotated[tuple[Renderer, ...], Meta(min_length=1)]  # ours first
    starts: Starts = Starts()
    # speed_ratio (at least), warm_seconds, cold_seconds (under)
    targets: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a benchmark without a time of ours: nothing can be compared with it."""
        if not self.renderers[0].seconds:
            raise ValueError("renderers: the first one needs at least one time")


def read_benchmark(path: Path) -> Benchmark:
    """Read and check benchmark.json; raise ReportError for what is wrong, and where."""
    return read_json(path, Benchmark, SCHEMA)
