"""What was measured of the atlas, limits.json."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from reports.errors import ReportError
from reports.limits.row import Row
from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json, write_json

SCHEMA = 1
FILE = "limits.json"

AS_SAID = "as said"
EARLY = "ALARM: it fails before its boundary"
AGREES = "ALARM: it holds behind its boundary"
BROKEN = "ALARM: it could not be measured"


@dataclass(frozen=True)
class MeasuredRow:
    """One row as it is today. None stands for what is no finite number."""

    name: str
    verdict: str
    before: float | None = None  # where the row says that the method holds
    behind: float | None = None  # where it says that it fails
    curve: tuple[tuple[float, float | None], ...] = ()  # (strength, measured)
    holds_to: float | None = None  # the boundary, found by halving: it lies between
    fails_from: float | None = None
    picture: str = ""  # data URI
    error: str = ""
    seconds: float = 0.0

    @property
    def alarm(self) -> bool:
        """Whether someone has to look."""
        return self.verdict != AS_SAID


@dataclass(frozen=True, kw_only=True)
class Limits(Circumstances):
    """The rows that were measured, in the order of the atlas."""

    rows: tuple[MeasuredRow, ...] = ()

    @property
    def alarms(self) -> tuple[MeasuredRow, ...]:
        """The rows that are not as the atlas says."""
        return tuple(row for row in self.rows if row.alarm)


def write_limits(path: Path, limits: Limits) -> None:
    """Write limits.json in one step."""
    write_json(path, limits, SCHEMA)


def read_limits(path: Path) -> Limits:
    """Read limits.json.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    return read_json(path, Limits, SCHEMA)


def with_texts(limits: Limits, atlas: tuple[Row, ...]) -> list[tuple[Row, MeasuredRow]]:
    """Return each measured row beside what the atlas says of it.

    Raises
    ------
    ReportError
        If a row is not in the atlas, or nothing was measured.
    """
    rows = {row.name: row for row in atlas}
    for one in limits.rows:
        if one.name not in rows:
            raise ReportError(f"row {one.name!r} is not in the atlas of this version")
    if not limits.rows:
        raise ReportError("no row of the atlas was measured")
    return [(rows[one.name], one) for one in limits.rows]
