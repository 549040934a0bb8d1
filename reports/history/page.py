"""The page of the records over commits, history.html."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from reports.charts.curves import line_chart
from reports.charts.figure import Point, Series
from reports.history.measures import MEASURES, Measure, values_of
from reports.history.versions import Version
from reports.look.formatting import number
from reports.look.template import fill


@dataclass(frozen=True)
class Section:
    """One measure on the page."""

    measure: Measure
    versions: Sequence[Version]
    names: Sequence[str]  # of the curves
    rows: Sequence[Sequence[str]]  # the numbers of each version, as text
    chart: Markup | None


def history_page(found: Mapping[str, Sequence[Version]]) -> str:
    """Return the whole page as HTML.

    Parameters
    ----------
    found
        The versions of each record, oldest first, by its file.
    """
    sections = [_section(one, found.get(one.record, ())) for one in MEASURES]
    return fill(
        "trials/history.html",
        sections=[one for one in sections if one.versions],
        missing=sorted({one.measure.record for one in sections if not one.versions}),
    )


def _section(measure: Measure, versions: Sequence[Version]) -> Section:
    values = [values_of(measure, version.content) for version in versions]
    names = list(dict.fromkeys(name for one in values for name in one))
    rows = [[number(one.get(name)) for name in names] for one in values]
    return Section(measure, versions, names, rows, _chart(measure, versions, values, names))


def _chart(
    measure: Measure,
    versions: Sequence[Version],
    values: Sequence[Mapping[str, float]],
    names: Sequence[str],
) -> Markup | None:
    """Return the curves, or None: one version is no history."""
    if len(versions) < 2 or not names:
        return None
    series = [
        Series(
            name,
            tuple(
                Point(k, one[name], tooltip=f"{name}, {_label(version)}: {one[name]:.3g}")
                for k, (one, version) in enumerate(zip(values, versions, strict=True))
                if name in one
            ),
        )
        for name in names
    ]
    return line_chart(
        series,
        x_label="commit",
        y_label=measure.unit,
        description=f"{measure.title}: {len(versions)} versions of {measure.record}.",
        tickvals=list(range(len(versions))),
        ticktext=[version.commit for version in versions],
    )


def _label(version: Version) -> str:
    return f"{version.created[:10]}, {version.commit}"
