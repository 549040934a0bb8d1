"""The page of any study: charts of quantities that have an axis, tables of the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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
OBVIOUS = "", "s", "times"  # units that a heading need not say


@dataclass(frozen=True)
class Section:
    """Values of one quantity, or of several of one case.

    `rows` has a text for each column; `charts` a caption and a chart.
    """

    title: str
    columns: list[str]
    rows: list[tuple[str, list[str]]]
    charts: list[tuple[str, Markup]]


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
    """Return a section for each quantity; those of the same lines of one case are one."""
    parts: dict[tuple[str, ...], list[Table]] = {}
    for quantity in table.distinct("quantity"):
        if quantity in APART:
            continue
        part = table.where(quantity=quantity)
        contenders, cases = part.distinct("contender"), part.distinct("case")
        together = len(cases) == 1 < len(contenders) and part.distinct("at") == [None]
        key = (cases[0], *contenders) if together else (quantity,)
        parts.setdefault(key, []).append(part)
    return [
        _section(study, found[0]) if len(key) == 1 else _of_one_case(key[0], found)
        for key, found in parts.items()
    ]


def _of_one_case(case: str, parts: list[Table]) -> Section:
    contenders = parts[0].distinct("contender")
    return Section(
        case,
        [_heading(part) for part in parts],
        [(one, [_cell(part, case, one) for part in parts]) for one in contenders],
        [],
    )


def _section(study: Study, table: Table) -> Section:
    contenders = table.distinct("contender")
    placed = Table(tuple(row for row in table if row.at is not None))
    bare = Table(tuple(row for row in table if row.at is None))
    charts = [
        (case, chart)
        for case in placed.distinct("case")
        if (chart := _chart(study, placed.where(case=case), _heading(table))) is not None
    ]
    if (dots := _dots(bare, _heading(table))) is not None:
        charts.append(("", dots))
    rows = [
        (case, [_cell(bare, case, contender) for contender in contenders])
        for case in bare.distinct("case")
    ]
    quantity = table.rows[0].quantity
    columns = [one or quantity for one in contenders]
    if not rows and len(places := sorted(placed.distinct("at"))) <= MOST_COLUMNS:
        columns = [f"{place:g}" for place in places]
        rows = [
            (
                ", ".join(filter(None, (case, contender))),
                [_cell(placed.where(at=place), case, contender) for place in places],
            )
            for case in placed.distinct("case")
            for contender in placed.where(case=case).distinct("contender")
        ]
    return Section(_heading(table), columns, rows, charts)


def _heading(table: Table) -> str:
    first = table.rows[0]
    title = first.quantity[:1].upper() + first.quantity[1:]
    return title if first.unit in OBVIOUS else f"{title} [{first.unit}]"


def _cell(table: Table, case: str, contender: str) -> str:
    found = table.where(case=case, contender=contender).rows
    return "; ".join(_text(row) for row in found) if found else formatting.NOTHING


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
    if len(cases) < 2 or not any(row.interval for row in drawn):
        return None
    values: dict[str, dict[str, float]] = {case: {} for case in cases}
    for row in drawn:
        values[row.case][row.contender] = float(row.value or 0.0)
    return dots_chart(
        list(values.items()),
        Table(tuple(drawn)).distinct("contender"),
        x_label=f"{label} [s]" if drawn[0].unit == "s" else label,
        description=f"{label}, of each case, with intervals of 95 %",
        intervals={(r.case, r.contender): r.interval for r in drawn if r.interval},
        guide=1.0 if drawn[0].unit == "times" else None,
    )


def _chart(study: Study, table: Table, label: str) -> Markup | None:
    quantity = table.rows[0].quantity
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
            series, x_label=study.axis, y_label=label, description=says, guide_slope=None
        )
    return line_chart(series, x_label=study.axis, y_label=label, description=says)


def _spread(points: list[Point]) -> float:
    """Return how many powers of ten the axis that spans more has."""
    places = [p.x for p in points], [p.y for p in points]
    return max(math.log10(max(values) / min(values)) for values in places)
