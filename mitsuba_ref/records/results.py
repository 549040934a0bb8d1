"""results.json, schema 1: the records that the harness writes and the report reads.

The fields of the records are the keys of the file, in order (`json_files` reads and writes
it). Numbers are finite or null: a value that could not be measured is null. Files of older
versions have the verdicts "pass", "fail" and "error" alone.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

from mitsuba_ref.records.verdicts import Verdict

SCHEMA: Literal[1] = 1


@dataclass(frozen=True)
class Metric:
    """One number about two pictures."""

    value: float | None
    floor: float | None  # the same number between Mitsuba renders with different seeds
    tolerance: float | None
    passed: bool | None  # None: shown, not judged
    meaning: str


@dataclass(frozen=True)
class AovResult:
    """One auxiliary channel, compared at pixel centres off the silhouettes."""

    name: str
    value: float | None
    tolerance: float
    passed: bool
    meaning: str
    compared_pixels: int
    edge_pixels: int


@dataclass(frozen=True)
class LadderPoint:
    """One rung of speed against accuracy."""

    renderer: str
    spp: int
    seconds: float
    rmse: float
    trimmed_rmse: float


@dataclass(frozen=True)
class Ladder:
    """Seconds against RMSE over doubling sample counts, measured in turn."""

    reference_spp: int
    note: str
    points: tuple[LadderPoint, ...]


@dataclass(frozen=True)
class Parting:
    """The first step in which two paths of a pixel part, from the same ray on both sides.

    Of a vector or a colour the two values are those of its worst component.
    """

    x: int  # from the left of the picture
    y: int  # from its top
    sample: int
    place: str  # "bounce 2"
    quantity: str
    ours: str
    reference: str
    error: float | None  # relative; null: a decision, which has none
    limit: float | None  # of that error, where no rounding has to explain it
    within_rounding: bool  # a move of the ray by rounding makes up for it
    likely: str  # what that kind of difference comes from


@dataclass(frozen=True)
class DivergentPixel:
    """A pixel whose paths parted although both renderers drew the same numbers."""

    x: int  # from the left of the picture
    y: int  # from its top
    ours: tuple[float, ...]  # linear sRGB
    reference: tuple[float, ...]
    relative: float  # difference
    cause: str = ""  # where the first path parted and why; empty: not traced
    parting: Parting | None = None  # the same as numbers; null: no single step parts


@dataclass(frozen=True, kw_only=True)
class ReplayResult:
    """Two pictures drawn with the same random numbers (`mitsuba_ref.replay`)."""

    spp: int = 0
    seed: int = 0
    pixels: int = 0
    divergent: int = 0
    divergent_allowed: int = 0
    rmse: float | None = None  # of the other pixels, relative to the mean
    rmse_limit: float = 0.0
    largest: float | None = None  # relative difference of a pixel that did not diverge
    passed: bool
    verdict: Verdict = "fail"  # of this comparison alone
    sentence: str
    seconds_ours: float | None = None
    seconds_reference: float | None = None
    changes: tuple[str, ...] = ()  # what Mitsuba rendered otherwise than the file says
    listed: tuple[DivergentPixel, ...] = ()  # the worst ones
    traced: int = 0  # pixels beyond the limits whose causes were looked at; 0: none
    unexplained: int = 0  # those of them that rounding does not explain
    excluded: float | None = None  # a share of such that the sample excludes, at 95 %
    partings: tuple[
        Parting, ...
    ] = ()  # of pixels that rounding does not explain, the first

    @property
    def explained(self) -> bool:
        """Whether it went beyond its limits and rounding explains all that was traced."""
        return self.traced > 0 and self.unexplained == 0


@dataclass(frozen=True)
class Rung:
    """One test of the ladder (`mitsuba_ref.ladder`), and what it was able to see."""

    name: str
    passed: bool
    statistic: float | None = None
    limit: float | None = None  # of the statistic; null: infinite
    p_value: float | None = None  # null: no noise is involved
    false_alarm_rate: float | None = None  # claimed: of an alarm although all is right
    detectable_bias: float | None = None  # seen with 99 % probability; null: not known
    detectable: str = ""  # what that number measures
    sentence: str = ""  # readable without knowledge of statistics


@dataclass(frozen=True)
class Finite:
    """How many values are not finite."""

    ours_nan: int = 0
    ours_inf: int = 0
    reference_nan: int = 0
    reference_inf: int = 0

    @property
    def passed(self) -> bool:
        """Whether every value is finite."""
        return not any(dataclasses.astuple(self))


@dataclass(frozen=True)
class Seconds:
    """Rendering alone; loading and compiling are apart."""

    ours: float | None = None
    ours_compile: float | None = None
    reference: float | None = None
    reference_threads: int | None = None
    ours_threads: int | None = None


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """Everything about one scene that was rendered twice, or why it was not."""

    name: str
    title: str = ""
    shows: str = ""
    path: str = ""
    integrator: str = ""
    reference_integrator: str = ""
    reference_note: str = ""
    method: str = ""
    explain: str = ""
    width: int = 0
    height: int = 0
    spp: int = 0
    seed: int = 0
    deterministic: bool = False
    verdict: Verdict
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()  # what is known to fail in such a scene
    notes: tuple[str, ...] = ()  # what a pass rests on, where that is not the usual
    finite: Finite = Finite()
    metrics: dict[str, Metric] = field(default_factory=dict)
    aovs: tuple[AovResult, ...] = ()
    seconds: Seconds = Seconds()
    commands: dict[str, str] = field(default_factory=dict)  # "ours", "reference"
    settings: dict[str, str] = field(default_factory=dict)
    images: dict[str, str] = field(default_factory=dict)  # .npy, relative to the JSON
    ladder: Ladder | None = None
    replay: tuple[ReplayResult, ...] = ()  # one for each number of samples
    rungs: tuple[Rung, ...] = ()  # up to the first broken one; empty: not climbed


@dataclass(frozen=True, kw_only=True)
class Results:
    """One run of the harness."""

    schema: Literal[1] = SCHEMA
    created: str  # ISO 8601
    command: str
    machine: dict[str, Any]
    versions: dict[str, str]
    commit: str  # "-dirty" at the end if the work tree differs
    scenes: tuple[SceneResult, ...]
