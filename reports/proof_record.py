"""What the page "proof" shows: results of the harness, and how far to trust them.

Replay and ladder stand in the scenes of results.json; the register, the mutation matrix
and the study of false alarms are files of their own, and any of them may be missing.
"""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_ref.false_alarms.alarm_counts import FalseAlarms, exceeds
from mitsuba_ref.mutations.matrix import Row
from mitsuba_ref.records.results import Results
from mitsuba_ref.records.verdicts import VERDICTS

STILL_DISAGREES = "still disagrees"

Ends = tuple[float | None, float | None]  # None: no end on that side


@dataclass(frozen=True)
class Circumstances:
    """Where the numbers of one file come from."""

    created: str
    command: str
    commit: str
    machine: dict[str, str]
    versions: dict[str, str]


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


@dataclass(frozen=True)
class Register:
    """The register of expected failures."""

    made: Circumstances
    entries: tuple[RegisterEntry, ...]


@dataclass(frozen=True)
class Matrix:
    """The mutation matrix."""

    made: Circumstances
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class AlarmStudy:
    """How often the ladder alarms when nothing is wrong."""

    made: Circumstances
    pairs: int
    comparisons: tuple[FalseAlarms, ...]


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
            f"{scene.title}: {(*scene.reasons, VERDICTS[scene.verdict].meaning)[0]}"
            for scene in self.results.scenes
            if scene.verdict != "pass"
        ]
        return [
            *scenes,
            *(_register_faults(self.register) if self.register else ()),
            *(_matrix_faults(self.matrix) if self.matrix else ()),
            *(_alarm_faults(self.alarms) if self.alarms else ()),
        ]


def _within(value: float | None, band: Ends) -> bool:
    low, high = band
    if value is None:
        return False
    return (low is None or low <= value) and (high is None or value <= high)


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
    if row.harmful:
        return "no check catches this defect"
    return f"{row.caught_by} alarms although nothing is wrong"


def _alarm_faults(alarms: AlarmStudy) -> list[str]:
    return [
        f"{one.scene}, {one.comparison}: the ladder alarms more often than it claims"
        for one in alarms.comparisons
        if exceeds(one)
    ]
