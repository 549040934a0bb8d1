"""The page of any study: charts of quantities that have an axis, tables of the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from markupsafe import Markup

from mitsuba_ref.records.other_programs import KEY
from reports.bench.rows import Row, Run, Table
from reports.bench.study import Study
from reports.charts.curves import line_chart, log_log_chart
from reports.charts.figure import Point, Series
from reports.charts.rows import dots_chart
from reports.look import formatting
from reports.look.template import fill

APART = "fault", "left out", "picture", "file"
MOST_COLUMNS = 8  # of a table over the axis of a study
MANY = 4  # contenders: their quantity is the title of a table of its own
OBVIOUS = "", "s", "times"  # units that a heading need not say


class Cell(NamedTuple):
    """What a table shows at one place."""

    text: str
    style: str  # class of the cell: numbers are set right and never broken


@dataclass(frozen=True)
class Section:
    """Values of one quantity, or of several in one table.

    `rows` has a cell for each column; `charts` a caption and a chart.
    """

    title: str
    columns: list[str]
    rows: list[tuple[str, list[Cell]]]
    charts: list[tuple[str, Markup]]
    alone: bool  # its table takes no further quantity


def study_page(name: str, study: Study, table: Table) -> str:
    """Return the page of a study as HTML.

    Parameters
    ----------
    name, study
        Its name and what it says about itself.
    table
        Its rows; not empty.
    """
    return fill(
        "study.html",
        name=name,
        study=study,
        verdict=study.verdict(table),
        run=circumstances_of(table),
        faults=table.faults,
        left_out=table.sentences("left out"),
        pictures=[row for row in table if row.quantity == "picture"],
        sections=_sections(study, table),
    )


def circumstances_of(table: Table) -> Run | None:
    """Return the newest run; its machine was as busy as in the worst of the cases."""
    run, busy = table.newest, table.cores_of_other_programs
    if run is None or busy is None:
        return run
    return replace(run, machine={**run.machine, KEY: busy})


def _sections(study: Study, table: Table) -> list[Section]:
    """Return a section for each quantity; small tables without a chart are put together."""
    sections: list[Section] = []
    tables: dict[tuple[str, ...], Section] = {}
    for quantity in table.distinct("quantity"):
        if quantity in APART:
            continue
        one = _section(study, table.where(quantity=quantity))
        lines = tuple(name for name, _ in one.rows)
        if one.alone or lines not in tables:
            sections.append(one)
            if not one.alone:
                tables[lines] = one
            continue
        first = tables[lines]
        first.columns.extend(one.columns)
        for (_, cells), (_, more) in zip(first.rows, one.rows, strict=True):
            cells.extend(more)
    return sections


def _section(study: Study, table: Table) -> Section:
    """Return charts and a table; of one case a line is a contender, else a case."""
    contenders, cases = table.distinct("contender"), table.distinct("case")
    placed = Table(tuple(row for row in table if row.at is not None))
    bare = Table(tuple(row for row in table if row.at is None))
    heading, charts = _heading(table), []
    for case in placed.distinct("case"):
        if (chart := _chart(study, placed.where(case=case), heading)) is not None:
            charts.append((case, chart))
    if (dots := _dots(bare, heading)) is not None:
        charts.append(("", dots))
    if bare and len(cases) == 1 < len(contenders):
        rows = [(name, [_cell(bare, cases[0], name)]) for name in contenders]
        return Section(_capital(cases[0]), [heading], rows, charts, bool(charts))
    many = len(contenders) > MANY
    columns = [
        one if many else f"{heading}: {one}" if one else heading for one in contenders
    ]
    rows = [
        (case, [_cell(bare, case, one) for one in contenders])
        for case in bare.distinct("case")
    ]
    if not rows and len(places := sorted(placed.distinct("at"))) <= MOST_COLUMNS:
        columns = [f"{place:g} {study.axis}" for place in places]
        rows = [
            (
                ", ".join(filter(None, (case, one))),
                [_cell(placed.where(at=place), case, one) for place in places],
            )
            for case in placed.distinct("case")
            for one in placed.where(case=case).distinct("contender")
        ]
    return Section(heading, columns, rows, charts, many or bool(charts))


def _heading(table: Table) -> str:
    first = table.rows[0]
    title = _capital(first.quantity)
    return title if first.unit in OBVIOUS else f"{title} [{first.unit}]"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cell(table: Table, case: str, contender: str) -> Cell:
    found = table.where(case=case, contender=contender).rows
    text = "; ".join(_text(row) for row in found) if found else formatting.NOTHING
    return Cell(text, "" if any(isinstance(row.value, str) for row in found) else "num")


def _text(row: Row) -> str:
    if isinstance(row.value, str):
        return row.value
    shown = formatting.seconds if row.unit == "s" else formatting.number
    text = shown(row.value)
    if row.interval is not None:
        low, high = row.interval
        text += f" ({shown(low)} to {shown(high)})"
    return text


def _dots(table: Table, label: str) -> Markup | None:
    """Return a chart of values with intervals of several cases; None: there are none."""
    drawn = [row for row in table if isinstance(row.value, float | int) and row.value > 0.0]
    cases = Table(tuple(drawn)).distinct("case")
    values = {row.value for row in drawn}
    if len(cases) < 2 or len(values) < 2 or not any(row.interval for row in drawn):
        return None
    lines: dict[str, dict[str, float]] = {case: {} for case in cases}
    for row in drawn:
        lines[row.case][row.contender] = float(row.value or 0.0)
    return dots_chart(
        list(lines.items()),
        Table(tuple(drawn)).distinct("contender"),
        x_label=drawn[0].unit,  # the heading says the rest
        description=f"{label}, of each case, with intervals of 95 %",
        intervals={(r.case, r.contender): r.interval for r in drawn if r.interval},
        guide=1.0 if drawn[0].unit == "times" else None,
    )


def _chart(study: Study, table: Table, label: str) -> Markup | None:
    quantity = table.rows[0].quantity
    label = f"{label} [s]" if table.rows[0].unit == "s" else label
    series = []
    for contender in table.distinct("contender"):
        points = tuple(
            Point(
                row.at,
                row.value,
                tooltip=f"{contender}, {study.axis} {row.at:g}: {_text(row)}",
                y_range=row.interval,
            )
            for row in table.curve(contender=contender)
            if isinstance(row.value, float) and row.at is not None
        )
        if points:
            series.append(Series(contender or quantity, points))
    if not series:
        return None
    every = [point for one in series for point in one.points]
    positive = all(point.x > 0.0 and point.y > 0.0 for point in every)
    says = f"{quantity} over {study.axis}: " + ", ".join(one.name for one in series)
    if positive and _spread(every) > 1.0:
        return log_log_chart(
            series,
            x_label=study.axis,
            y_label=label,
            description=says,
            guide_slope=None,
        )
    return line_chart(series, x_label=study.axis, y_label=label, description=says)


def _spread(points: list[Point]) -> float:
    """Return how many powers of ten the axis that spans more has."""
    places = [p.x for p in points], [p.y for p in points]
    return max(math.log10(max(values) / min(values)) for values in places)
