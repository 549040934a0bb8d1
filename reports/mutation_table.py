"""The mutation matrix as a table: defects by rungs, harmless changes apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mitsuba_ref.mutations.matrix import Row
from mitsuba_ref.mutations.rungs import LADDER, Rung


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
    cells: tuple[Cell, ...]
    first: Rung | None  # the rung that catches it


@dataclass(frozen=True)
class MutationTable:
    """All of the matrix."""

    columns: tuple[str, ...]
    harmful: tuple[MutationRow, ...]  # what no check catches comes first
    neutral: tuple[MutationRow, ...]

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
    cells = []
    for name in columns:
        rung = by_name.get(name)
        if name in row.broken:
            cells.append(Cell("broken", "outside", "sees the unchanged renderer as well"))
        elif rung is None:
            cells.append(Cell("·", "muted", "not asked"))
        elif not rung.caught:
            cells.append(Cell("no", "muted", rung.why))
        elif row.harmful:
            cells.append(Cell("✓ first" if rung is first else "✓ seen", "seen", rung.why))
        else:
            cells.append(Cell("✗ alarm", "outside", rung.why))
    return MutationRow(row, tuple(cells), first)
