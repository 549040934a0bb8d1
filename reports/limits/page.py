"""The page of the atlas, limits.html: a table of all rows, then a section for each."""

from __future__ import annotations

import re
from dataclasses import dataclass

from markupsafe import Markup

from reports.charts.boundary import boundary_chart
from reports.limits.atlas import CHAPTERS, Chapter
from reports.limits.record import Limits, MeasuredRow, with_texts
from reports.limits.row import Row
from reports.look.formatting import number
from reports.look.template import fill

_EXPONENT = re.compile(r"\^(\([^)]*\)|-?\d+)")


@dataclass(frozen=True)
class Section:
    """One row on the page."""

    row: Row
    measured: MeasuredRow
    gives_way: str  # the boundary in words
    chart: Markup | None


def limits_page(limits: Limits, chapters: tuple[Chapter, ...] = CHAPTERS) -> str:
    """Return the whole page as HTML.

    Raises
    ------
    ReportError
        If a row is not in the atlas.
    """
    rows = tuple(row for chapter in chapters for row in chapter.rows)
    sections = [_section(row, one) for row, one in with_texts(limits, rows)]
    shown = [
        (chapter, [section for section in sections if section.row in chapter.rows])
        for chapter in chapters
    ]
    return fill(
        "trials/limits.html",
        filters={"powers": with_powers, "label": _label},
        record=limits,
        chapters=[(chapter, found) for chapter, found in shown if found],
    )


def gives_way(row: Row, measured: MeasuredRow) -> str:
    """Return where the method leaves its tolerance, in words."""
    if measured.holds_to is None:
        return "not measured"
    if measured.fails_from is None:
        return f"not up to {number(measured.holds_to)}"
    low, high = number(measured.holds_to), number(measured.fails_from)
    return low if low == high else f"between {low} and {high}"


def _label(row: Row) -> str:
    """Return what the curve is of: a bare share gets its noun."""
    return f"share {row.unit}" if row.unit.startswith("of ") else row.unit


def with_powers(text: str) -> Markup:
    """Return the text with exponents raised: 10^-3, n^(1/3)."""
    parts = _EXPONENT.split(text)
    raised = (Markup("<sup>{}</sup>").format(part.strip("()")) for part in parts[1::2])
    pieces = [Markup.escape(parts[0])]
    for power, rest in zip(raised, parts[2::2], strict=True):
        pieces += [power, Markup.escape(rest)]
    return Markup("").join(pieces)


def _section(row: Row, measured: MeasuredRow) -> Section:
    words = gives_way(row, measured)
    if not measured.curve or measured.holds_to is None:
        return Section(row, measured, words, None)
    chart = boundary_chart(
        measured.curve,
        tolerance=row.tolerance,
        boundary=(measured.holds_to, measured.fails_from),
        x_label=row.stress,
        y_label=row.quantity,
        description=f"{row.method}: {_label(row)}, over {row.stress}; gives way {words}.",
    )
    return Section(row, measured, words, chart)
