"""accelerators.json as records: what each structure and each peer did on which scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json

SCHEMA = 2

AboveZero = Annotated[float, Meta(gt=0.0)]
Rounds = Annotated[tuple[AboveZero, ...], Meta(min_length=1)]
Times = dict[str, dict[int, Rounds]]  # by kind of rays and threads


@dataclass(frozen=True)
class Work:
    """What a structure did for one ray on average; of the stack the largest."""

    nodes: float
    boxes: float
    primitives: float
    saved: float
    stack: int


@dataclass(frozen=True)
class StructureRow:
    """One structure on one scene; `fault` says why it is not timed."""

    name: str
    fault: str
    build_seconds: tuple[float, ...]
    bytes: int
    depth: int | None
    cost: float | None
    work: dict[str, Work]  # by kind of rays
    rays: dict[str, int]  # by kind: how many of the scene's rays were traced in a turn
    nanoseconds: Times  # per ray


@dataclass(frozen=True)
class Agreement:
    """The shares of a kind of rays for which a peer agrees with us."""

    same_distance: float
    same_primitive: float | None = None  # not asked for any hit


@dataclass(frozen=True)
class PeerRow:
    """One peer on one scene; `fault` says why there are no times."""

    name: str
    fault: str
    build_seconds: tuple[float, ...]
    agreement: dict[str, Agreement]  # by kind
    nanoseconds: Times


@dataclass(frozen=True)
class StudyScene:
    """One scene."""

    name: str
    title: str
    about: str
    triangles: int
    rays: dict[str, int]  # by kind
    structures: Annotated[tuple[StructureRow, ...], Meta(min_length=1)]
    peers: tuple[PeerRow, ...]
    auto: dict[int, str]  # expected rays -> what `--accel auto` takes


@dataclass(frozen=True)
class GrowthPoint:
    """One structure at one size."""

    triangles: int
    build_seconds: float
    bytes: int
    nanoseconds: dict[str, float]  # per ray, by kind, one thread


@dataclass(frozen=True)
class GrowthSeries:
    """One structure at growing sizes; `stopped` says why it goes no further."""

    name: str
    stopped: str
    points: tuple[GrowthPoint, ...]


@dataclass(frozen=True)
class Growth:
    """The study of growth."""

    title: str
    kinds: tuple[str, ...]
    memory_limit: int  # [bytes]
    peak_bytes: int
    series: tuple[GrowthSeries, ...]


@dataclass(frozen=True)
class FigureRow:
    """One structure at the lecture's figure."""

    name: str
    rays: int  # that one thread measured
    nanoseconds: dict[int, float]  # per ray, by threads
    tests: float  # of primitives, per ray


@dataclass(frozen=True)
class Figure:
    """The lecture's figure: one camera ray for each pixel."""

    width: int
    height: int
    triangles: int
    rows: tuple[FigureRow, ...]


@dataclass(frozen=True)
class WorkMap:
    """What each pixel cost one structure."""

    name: str
    mean: float
    ball_tests: float | None  # primitive tests of a ray that hits the ball in the stadium
    work: tuple[tuple[int, ...], ...]  # (height, width)


@dataclass(frozen=True)
class WorkMaps:
    """The maps of one scene."""

    scene: str
    width: int
    height: int
    maps: tuple[WorkMap, ...]

    def __post_init__(self) -> None:
        """Refuse a map of another size: its pixels would be in the wrong places."""
        for one in self.maps:
            rows = {len(row) for row in one.work}
            if len(one.work) != self.height or rows - {self.width}:
                size = f"{self.width} x {self.height}"
                raise ValueError(f"the map of {one.name} is not of {size} numbers")


@dataclass(frozen=True)
class Kind:
    """One kind of rays, in words."""

    name: str
    title: str
    about: str


@dataclass(frozen=True, kw_only=True)
class AcceleratorStudy(Circumstances):
    """A whole accelerators.json."""

    size: str
    threads: int
    rounds: int
    naive: str
    kinds: tuple[Kind, ...]
    scenes: Annotated[tuple[StudyScene, ...], Meta(min_length=1)]
    figure: Figure | None = None
    maps: tuple[WorkMaps, ...] = ()
    growth: Growth
    # of FURTHER_STUDIES, each as it measures it
    further: dict[str, Any] = field(default_factory=dict)

    @property
    def faults(self) -> list[str]:
        """What is wrong with our own structures, one sentence each."""
        return [
            f"{row.name} on {scene.name}: {row.fault}"
            for scene in self.scenes
            for row in scene.structures
            if row.fault
        ]


def read_accelerators(path: Path) -> AcceleratorStudy:
    """Read and check accelerators.json; raise ReportError for what is wrong, and where."""
    return read_json(path, AcceleratorStudy, SCHEMA)
