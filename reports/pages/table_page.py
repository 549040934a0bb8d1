"""One table for a study: a row for each case, a column for each quantity and contender."""

from __future__ import annotations

from dataclasses import dataclass

from reports.bench.rows import Row, Table
from reports.bench.study import Study
from reports.look import formatting
from reports.look.template import fill

APART = "fault", "picture"
LONG = 24  # characters of a text from which on its column is a wide one


Column = tuple[str, str, str]  # quantity, contender, unit


@dataclass(frozen=True)
class Cell:
    """What a case has in a column; `style` are classes of the style sheet."""

    text: str
    style: str = ""


def table_page(name: str, study: Study, table: Table) -> str:
    """Return a page with all rows of a study in one table that can be sorted."""
    columns = _columns(table)
    by_place = {(row.case, row.quantity, row.contender): row for row in table}
    faulty = {row.case for row in table.where(quantity="fault")}
    rows = [
        (
            case,
            case in faulty,
            [_cell(by_place.get((case, quantity, one))) for quantity, one, _ in columns],
        )
        for case in table.distinct("case")
    ]
    rows.sort(key=lambda row: not row[1])
    return fill(
        "table.html",
        name=name,
        study=study,
        verdict=study.verdict(table),
        run=table.newest,
        faults=table.faults,
        columns=[_heading(*column) for column in columns],
        rows=rows,
    )


def _columns(table: Table) -> list[Column]:
    """Return the columns: those of contenders together, where the first of them is."""
    every = list(
        dict.fromkeys(
            (row.quantity, row.contender, row.unit)
            for row in table
            if row.quantity not in APART
        )
    )
    together = [column for column in every if column[1]]
    first = every.index(together[0]) if together else len(every)
    return [
        *every[:first],
        *together,
        *(column for column in every[first:] if not column[1]),
    ]


def _heading(quantity: str, contender: str, unit: str) -> str:
    title = contender or quantity
    return f"{title} [{unit}]" if unit else title


def _cell(row: Row | None) -> Cell:
    if row is None:
        return Cell("")
    if isinstance(row.value, str):
        style = "meaning" if len(row.value) > LONG else ""
        return Cell(row.value, {"seen": "seen", "no": "muted"}.get(row.value, style))
    return Cell(formatting.number(row.value), "num")
