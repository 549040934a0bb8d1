"""The mutation matrix as a table: defects by rungs, harmless changes apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mitsuba_ref.mutations.matrix import Row
from mitsuba_ref.mutations.rungs import CLIMB, LADDER, Rung


@dataclass(frozen=True)
class Cell:
    """What one rung says of one mutation."""

    text: str  # stands in the table
    style: str  # class of the style sheet
    why: str  # the check's own sentence


@dataclass(frozen=True)
class MutationRow:
    """One mutation, ready to be drawn."""

    row: Row
    cells: tuple[Cell, ...]  # one for each column
    first: Rung | None  # the rung that catches it
    climbed: Rung | None  # the lowest rung of the ladder of tests that breaks
    ladder: Cell  # what the ladder says as a whole

    @property
    def climbs(self) -> bool:
        """Whether the ladder was climbed."""
        return any(rung.name.startswith(CLIMB) for rung in self.row.rungs)


@dataclass(frozen=True)
class MutationTable:
    """All of the matrix."""

    columns: tuple[str, ...]
    harmful: tuple[MutationRow, ...]  # what no check catches comes first
    neutral: tuple[MutationRow, ...]

    @property
    def ladder(self) -> tuple[str, ...]:
        """The columns of the ladder of tests, which have a table of their own."""
        return tuple(name for name in self.columns if name.startswith(CLIMB))

    @property
    def holes(self) -> int:
        """How many defects no check catches."""
        return sum(one.first is None for one in self.harmful)

    @property
    def unexpected(self) -> int:
        """How many rows are not as they should be."""
        return sum(not one.row.as_expected for one in (*self.harmful, *self.neutral))


def mutation_table(rows: Sequence[Row]) -> MutationTable:
    """Sort the rows and find the cell of each rung."""
    there = dict.fromkeys(rung.name for row in rows for rung in row.rungs)
    known = [name for name in LADDER if name in there]
    columns = (*known, *(name for name in there if name not in known))
    drawn = [_row(row, columns) for row in rows]
    drawn.sort(key=lambda one: one.row.as_expected)
    return MutationTable(
        columns=columns,
        harmful=tuple(one for one in drawn if one.row.harmful),
        neutral=tuple(one for one in drawn if not one.row.harmful),
    )


def _row(row: Row, columns: Sequence[str]) -> MutationRow:
    by_name = {rung.name: rung for rung in row.rungs}
    first = by_name.get(row.caught_by or "")
    climbed = next((r for r in row.rungs if r.caught and r.name.startswith(CLIMB)), None)
    cells = tuple(_cell(name, by_name.get(name), row) for name in columns)
    return MutationRow(row, cells, first, climbed, _whole_ladder(row, climbed))


def _cell(name: str, rung: Rung | None, row: Row) -> Cell:
    if name in row.broken:
        return Cell("broken", "outside", "sees the unchanged renderer as well")
    if rung is None:
        return Cell("·", "muted", "not asked")
    if not rung.caught:
        return Cell("no", "muted", rung.why)
    if not row.harmful:
        return Cell("✗ alarm", "outside", rung.why)
    return Cell("✓ first" if name == row.caught_by else "✓ seen", "seen", rung.why)


def _whole_ladder(row: Row, climbed: Rung | None) -> Cell:
    """Return one cell for the ladder: that of its lowest broken rung, with its name."""
    rungs = [rung for rung in row.rungs if rung.name.startswith(CLIMB)]
    shown = climbed or next(iter(rungs), None)
    cell = _cell("", None, row) if shown is None else _cell(shown.name, shown, row)
    if climbed is None:
        return cell
    return replace(cell, text=f"{cell.text}: {climbed.name.removeprefix(CLIMB)}")
