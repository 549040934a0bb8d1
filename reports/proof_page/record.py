"""What the page "proof" shows: results of the harness, and how far to trust them.

Replay and ladder stand in the scenes of results.json; the register, the mutation matrix
and the study of false alarms are files of their own, and any of them may be missing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar

from msgspec import Meta

from mitsuba_ref.false_alarms.alarm_counts import FalseAlarms, exceeds
from mitsuba_ref.false_alarms.binomial import Rate
from mitsuba_ref.mutations.matrix import Row
from mitsuba_ref.records.failures import failures
from mitsuba_ref.records.results import Results, SceneResult
from mitsuba_ref.records.verdicts import VERDICTS
from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json
from reports.records.measured import newest
from reports.records.results import read_results

SCHEMA = 1
REGISTER, MATRIX, ALARMS = "register.json", "matrix.json", "false_alarms.json"
STILL_DISAGREES = "still disagrees"

Part = TypeVar("Part")

Ends = tuple[float | None, float | None]  # None: no end on that side


@dataclass(frozen=True)
class RegisterEntry:
    """One known disagreement, and what it says today."""

    name: str
    what: str
    reason: str
    expected: float
    band: Ends
    agreement: Ends
    measured: float | None  # None: no number
    verdict: str

    @property
    def alarm(self) -> bool:
        """Whether someone has to look, by the verdict or by the number itself."""
        return self.verdict != STILL_DISAGREES or not _within(self.measured, self.band)


@dataclass(frozen=True, kw_only=True)
class Register(Circumstances):
    """The register of expected failures."""

    entries: Annotated[tuple[RegisterEntry, ...], Meta(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class Matrix(Circumstances):
    """The mutation matrix."""

    rows: Annotated[tuple[Row, ...], Meta(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class AlarmStudy(Circumstances):
    """How often the ladder alarms when nothing is wrong."""

    pairs: int
    comparisons: Annotated[tuple[FalseAlarms, ...], Meta(min_length=1)]

    def __post_init__(self) -> None:
        """Refuse a comparison without rungs, and a rate that is no share."""
        for one in self.comparisons:
            if not one.rungs:
                raise ValueError(f"{one.scene}, {one.comparison}: there are no rungs")
            for rung in one.rungs:
                for rate in (rung.alarms, rung.below_often):
                    if rate is not None and not _is_share(rate):
                        raise ValueError(f"{one.scene}, {rung.name}: {rate} is no share")


@dataclass(frozen=True)
class ProofRecord:
    """All that the page is drawn from."""

    results: Results
    register: Register | None
    matrix: Matrix | None
    alarms: AlarmStudy | None

    @property
    def faults(self) -> list[str]:
        """Everything that is not as it should be, one sentence each."""
        scenes = [
            f"{scene.title}: {_what_failed(scene)}"
            for scene in self.results.scenes
            if scene.verdict != "pass"
        ]
        return [
            *scenes,
            *(_register_faults(self.register) if self.register else ()),
            *(_matrix_faults(self.matrix) if self.matrix else ()),
            *(_alarm_faults(self.alarms) if self.alarms else ()),
        ]


def read_proof_record(source: Path) -> ProofRecord:
    """Read results.json, and the other files beside it or in the folder above.

    Of these the repository has records too, which are read where they are newer.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    return ProofRecord(
        results=read_results(source),
        register=_if_there(REGISTER, source.parent, read_register),
        matrix=_if_there(MATRIX, source.parent, read_matrix),
        alarms=_if_there(ALARMS, source.parent, read_alarms),
    )


def _if_there(name: str, folder: Path, read: Callable[[Path], Part]) -> Part | None:
    places = (folder / name, folder.parent / name)
    path = newest(next((place for place in places if place.exists()), places[0]))
    return read(path) if path.exists() else None


def read_register(path: Path) -> Register:
    """Read register.json; raise ReportError for what is wrong."""
    return read_json(path, Register, SCHEMA)


def read_matrix(path: Path) -> Matrix:
    """Read matrix.json; raise ReportError for what is wrong.

    What catches a mutation, and whether that is as expected, follows from its rungs.
    """
    return read_json(path, Matrix, SCHEMA)


def read_alarms(path: Path) -> AlarmStudy:
    """Read false_alarms.json; raise ReportError for what is wrong."""
    return read_json(path, AlarmStudy)  # its first version has no schema


def _is_share(rate: Rate) -> bool:
    share = 0 <= rate.count <= rate.trials and rate.trials > 0
    return share and 0.0 <= rate.low <= rate.high <= 1.0


def _within(value: float | None, band: Ends) -> bool:
    low, high = band
    if value is None:
        return False
    return (low is None or low <= value) and (high is None or value <= high)


def _what_failed(scene: SceneResult) -> str:
    """Return the names of what is beyond its limit, or else why there is nothing."""
    if scene.verdict == "fail" and (found := failures(scene)):
        return f"beyond its limit: {'; '.join(one.quantity for one in found)}"
    return (*scene.reasons, VERDICTS[scene.verdict].meaning)[0]


def _register_faults(register: Register) -> list[str]:
    return [
        f"Expected failure “{entry.name}”: {_changed(entry)}"
        for entry in register.entries
        if entry.alarm
    ]


def _changed(entry: RegisterEntry) -> str:
    if _within(entry.measured, entry.agreement):
        return "it agrees now: the check has gone blind or the method was changed"
    return f"it was {entry.expected:.4g} and is {entry.measured} today"


def _matrix_faults(matrix: Matrix) -> list[str]:
    return [
        f"Mutation “{row.mutation}” on {row.scene}: {_unexpected(row)}"
        for row in matrix.rows
        if not row.as_expected
    ]


def _unexpected(row: Row) -> str:
    if row.broken:
        return f"{', '.join(row.broken)} also sees the unchanged renderer"
    if not row.compiles:
        return "it does not compile any more, so that it shows nothing"
    if row.harmful:
        return "no check catches this defect"
    return f"{row.caught_by} alarms although nothing is wrong"


def _alarm_faults(alarms: AlarmStudy) -> list[str]:
    return [
        f"{one.scene}, {one.comparison}: the ladder alarms more often than it claims"
        for one in alarms.comparisons
        if exceeds(one)
    ]
