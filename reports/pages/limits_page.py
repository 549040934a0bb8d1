"""The page "where methods fail": pictures of failures first, then a section for each."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from reports.atlas import Case, Method, every_case, read_atlas
from reports.bench.rows import Table
from reports.bench.study import Study
from reports.charts.boundary import BoundedCurve, boundary_chart
from reports.charts.figure import COLOURS, SYMBOLS
from reports.errors import ReportError
from reports.look.formatting import number
from reports.look.template import fill

# the first pictures of the page: the five that show most at a glance
FIRST = "offset-acne", "offset-gap", "triangle-size", "sum", "stadium"
GLYPHS = "●■▲◆▼✚○□△◇▽✛"  # the symbols of charts, in their order; then open


@dataclass(frozen=True)
class MethodLine:
    """One method of a case: its mark in the chart, where it gives way, both sides."""

    name: str
    method: Method
    glyph: str
    colour: str
    gives_way: str
    tolerance: float
    holds: float
    before: float | None
    behind: float | None


@dataclass(frozen=True)
class Section:
    """One case on the page."""

    case: Case
    methods: list[MethodLine]
    chart: Markup | None
    picture: str  # path, or ""
    faults: list[str]


def limits_page(name: str, study: Study, table: Table) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    name, study
        Its name and what it says about itself.
    table
        What was measured. The texts come from the atlas of this version; cases that it
        lacks are left out.

    Raises
    ------
    ReportError
        If no case of the atlas was measured.
    """
    sections = {
        case.name: _section(case, table.where(case=case.name))
        for case in every_case().values()
        if table.where(case=case.name)
    }
    if not sections:
        raise ReportError("no case of the atlas of this version was measured")
    chapters = [
        (chapter.title, [sections[c.name] for c in chapter.cases if c.name in sections])
        for chapter in read_atlas().values()
    ]
    ordered = dict.fromkeys((*FIRST, *sections))
    return fill(
        "limits.html",
        name=name,
        study=study,
        run=table.newest,
        gallery=[sections[n] for n in ordered if n in sections and sections[n].picture],
        chapters=[(title, found) for title, found in chapters if found],
        methods=sum(len(section.methods) for section in sections.values()),
        faulty=[section for section in sections.values() if section.faults],
        cases=len(sections),
    )


def _section(case: Case, table: Table) -> Section:
    curves, lines = [], []
    for place, (name, method) in enumerate(case.methods.items()):
        own = table.where(contender=name)
        found = own.where(quantity="boundary").rows
        interval = found[0].interval if found else None
        points = [(row.at, row.value) for row in own.curve(quantity="curve")]
        curves.append(BoundedCurve(method.title, points, interval))  # type: ignore[arg-type]
        lines.append(
            MethodLine(
                name,
                method,
                GLYPHS[place % len(GLYPHS)],
                COLOURS[place % len(SYMBOLS)],
                gives_way(case, name, interval),
                case.tolerance_of(name),
                case.holds(name),
                own.value(quantity="before"),
                own.value(quantity="behind"),
            )
        )
    chart = None
    if any(curve.points for curve in curves):
        says = "; ".join(f"{line.method.title}: {line.gives_way}" for line in lines)
        chart = boundary_chart(
            curves,
            tolerance=case.tolerance,
            x_label="",  # the page has the labels: they are too long for an axis
            y_label="",
            description=f"{case.measured} over {case.stress}. {says}.",
        )
    pictures = table.where(quantity="picture").rows
    faults = [str(row.value) for row in table.where(quantity="fault")]
    picture = str(pictures[0].value) if pictures else ""
    return Section(case, lines, chart, picture, faults)


def gives_way(case: Case, name: str, interval: tuple[float, float] | None) -> str:
    """Return where a method leaves its tolerance, in words."""
    method = case.methods[name]
    if method.fails is None:
        return f"no limit up to {_strength(case.holds(name))}"
    if interval is None:
        return "see the fault"
    low, high = interval
    if method.fails < case.holds(name):
        return f"fails below {_strength(low)}"
    if low > 0.0 and high < 1.5 * low:
        return f"fails from {_strength(high)} on"
    return f"fails between {_strength(low)} and {_strength(high)}"


def _strength(value: float) -> str:
    """Return two digits that matter: 9300, 1.2e4."""
    if value < 1e4:
        return number(value, 2)
    mantissa, power = f"{value:.1e}".split("e")
    return f"{float(mantissa):g}e{int(power)}"
