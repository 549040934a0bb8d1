"""The page of all studies over their runs: how measured numbers changed with commits."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from reports.bench.rows import Run, Table
from reports.bench.study import Study
from reports.charts.curves import line_chart
from reports.charts.figure import Point, Series
from reports.look.formatting import number
from reports.look.template import fill

MOST = 8  # curves of a chart; more are drawn as their mean
TICKS = 4  # commits named at the axis
FIRST = 4  # quantities of a study that names no headlines

Curves = dict[str, list[float | None]]  # by name, a value for each run


@dataclass(frozen=True)
class Section:
    """One quantity of one study."""

    study: Study
    quantity: str
    runs: list[Run]
    curves: Curves
    chart: Markup


def history_page(studies: Mapping[str, tuple[Study, Table]]) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    studies
        Each with all its rows, of all runs.
    """
    sections, once = [], []
    for study, table in studies.values():
        found = _sections(study, table)
        sections += found
        if table and not found:
            once.append(study.title)
    return fill("history.html", filters={"number": number}, sections=sections, once=once)


def _sections(study: Study, table: Table) -> list[Section]:
    used = set(table.distinct("run"))
    whole = [run for run in table.runs.values() if run.full and run.run in used]
    runs = sorted(whole, key=lambda run: run.created)
    found = []
    for quantity in study.headlines or _quantities(table):
        curves = _faults(runs, table) if quantity == "faults" else None
        curves = curves or curves_of(runs, table.where(quantity=quantity))
        if curves and max(sum(v is not None for v in c) for c in curves.values()) > 1:
            chart = _chart(study, quantity, runs, curves)
            found.append(Section(study, quantity, runs, curves, chart))
    return found


def _quantities(table: Table) -> list[str]:
    numbers = [row for row in table if row.at is None and isinstance(row.value, float)]
    return Table(tuple(numbers)).distinct("quantity")[:FIRST]


def _faults(runs: list[Run], table: Table) -> Curves:
    faults = [row.run for row in table.where(quantity="fault")]
    return {"faults found by the run": [float(faults.count(run.run)) for run in runs]}


def curves_of(runs: list[Run], table: Table) -> Curves:
    """Return the values of one quantity that were the newest after each run.

    A curve is a contender, or a case if there is one contender, and a value the mean of
    what it has of the others: geometric, if all are above 0. Where a run measured some of
    the cases alone, the others keep their values.
    """
    by = "contender" if len(table.distinct("contender")) > 1 else "case"
    names = table.distinct(by)
    alike = len(names) > MOST
    newest: dict[tuple[str, str], float] = {}
    curves: Curves = {name: [] for name in (["mean of all"] if alike else names)}
    for run in runs:
        for row in table.where(run=run.run):
            if isinstance(row.value, float) and row.at is None:
                newest[row.case, row.contender] = row.value
        for name, curve in curves.items():
            values = [
                value
                for (case, contender), value in newest.items()
                if alike or name == (contender if by == "contender" else case)
            ]
            curve.append(_mean(values))
    return curves


def _mean(values: list[float]) -> float | None:
    if len(values) < 2:
        return values[0] if values else None
    positive = min(values) > 0.0
    return (statistics.geometric_mean if positive else statistics.fmean)(values)


def _chart(study: Study, quantity: str, runs: list[Run], curves: Curves) -> Markup:
    places = list(enumerate(f"{run.created[:10]}, {run.commit}" for run in runs))
    series = [
        Series(
            name or quantity,
            tuple(
                Point(k, value, tooltip=f"{name}, {label}: {value:.3g}")
                for (k, label), value in zip(places, curve, strict=True)
                if value is not None and math.isfinite(value)
            ),
        )
        for name, curve in curves.items()
    ]
    shown = list(enumerate(runs))[:: -(-len(runs) // TICKS)]
    return line_chart(
        series,
        x_label="commit",
        y_label=quantity,
        description=f"{study.title}: {quantity} in {len(runs)} runs.",
        tickvals=[k for k, _ in shown],
        ticktext=[run.commit[:7] for _, run in shown],
    )
