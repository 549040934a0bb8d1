"""The page of any study: charts of quantities that have an axis, tables of the others."""

from __future__ import annotations

import math
from dataclasses import dataclass

from markupsafe import Markup

from reports.bench.rows import Row, Table
from reports.bench.study import Study
from reports.charts.curves import line_chart, log_log_chart
from reports.charts.figure import Point, Series
from reports.look import formatting
from reports.look.template import fill

APART = "fault", "picture", "file"


@dataclass(frozen=True)
class Section:
    """One quantity of one unit.

    `cells` has a row for each case and a text for each contender; `charts` one chart for
    each case, if the quantity has an axis.
    """

    title: str
    unit: str
    contenders: list[str]
    cells: list[tuple[str, list[str]]]
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
        run=table.newest,
        faults=table.faults,
        pictures=[row for row in table if row.quantity == "picture"],
        sections=[
            _section(study, table.where(quantity=quantity))
            for quantity in table.distinct("quantity")
            if quantity not in APART
        ],
    )


def _section(study: Study, table: Table) -> Section:
    contenders = table.distinct("contender")
    unit = next((row.unit for row in table if row.unit), "")
    placed = Table(tuple(row for row in table if row.at is not None))
    bare = Table(tuple(row for row in table if row.at is None))
    title = table.rows[0].quantity
    charts = [
        (case, chart)
        for case in placed.distinct("case")
        if (chart := _chart(study, placed.where(case=case), title, unit)) is not None
    ]
    cells = [
        (case, [_cell(bare, case, contender) for contender in contenders])
        for case in bare.distinct("case")
    ]
    return Section(title, unit, contenders, cells, charts)


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


def _chart(study: Study, table: Table, quantity: str, unit: str) -> Markup | None:
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
    label = f"{quantity} [{unit}]" if unit else quantity
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
