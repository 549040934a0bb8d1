"""The page of the atlas, limits.html: a table of all rows, then a section for each."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from reports.charts.boundary import boundary_chart
from reports.limits.atlas import ATLAS
from reports.limits.record import Limits, MeasuredRow, with_texts
from reports.limits.row import Row
from reports.page.formatting import number
from reports.page.template import fill

CHAPTERS = {
    "numbers": "Numbers: what float32 loses",
    "structures": "Structures: scenes that an accelerator was not made for",
    "light": "Light: paths that are not found, or too seldom",
    "comparing": "Comparing: pictures that cannot be told apart, or should not be",
}


@dataclass(frozen=True)
class Section:
    """One row on the page."""

    row: Row
    measured: MeasuredRow
    gives_way: str  # the boundary in words
    chart: Markup | None


@dataclass(frozen=True)
class Chapter:
    """The sections of one chapter."""

    name: str
    title: str
    sections: tuple[Section, ...]


def limits_page(limits: Limits, atlas: tuple[Row, ...] = ATLAS) -> str:
    """Return the whole page as HTML.

    Raises
    ------
    ReportError
        If a row is not in the atlas.
    """
    sections = [_section(row, one) for row, one in with_texts(limits, atlas)]
    chapters = [
        Chapter(name, title, tuple(s for s in sections if s.row.chapter == name))
        for name, title in CHAPTERS.items()
    ]
    return fill(
        "limits.html", record=limits, chapters=[one for one in chapters if one.sections]
    )


def gives_way(row: Row, measured: MeasuredRow) -> str:
    """Return where the method leaves its tolerance, in words."""
    if measured.holds_to is None:
        return "not measured"
    if measured.fails_from is None:
        return f"not up to {number(measured.holds_to)}"
    low, high = number(measured.holds_to), number(measured.fails_from)
    return low if low == high else f"between {low} and {high}"


def _section(row: Row, measured: MeasuredRow) -> Section:
    words = gives_way(row, measured)
    if not measured.curve or measured.holds_to is None:
        return Section(row, measured, words, None)
    chart = boundary_chart(
        measured.curve,
        tolerance=row.tolerance,
        boundary=(measured.holds_to, measured.fails_from),
        x_label=row.stress,
        y_label=row.unit,
        description=f"{row.method}: {row.unit}, over {row.stress}. It gives way: {words}.",
    )
    return Section(row, measured, words, chart)
