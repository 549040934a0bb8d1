"""The page of the trials, soak.html."""

from __future__ import annotations

from markupsafe import Markup

from reports.charts.curves import line_chart
from reports.charts.figure import Point, Series
from reports.look.template import fill
from reports.soak.record import Part, Soak
from reports.soak.studies import STUDIES


def soak_page(soak: Soak) -> str:
    """Return the whole page as HTML."""
    shown = [(study, soak.parts.get(study.name, Part())) for study in STUDIES]
    return fill(
        "trials/soak.html",
        filters={"grouped": _grouped},
        record=soak,
        shown=[(study, part, _chart(part)) for study, part in shown],
    )


def _grouped(number: int) -> str:
    return f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _chart(part: Part) -> Markup | None:
    """Return the curve of memory over the progress of the last process."""
    if len(part.curve) < 2:
        return None
    last = len(part.curve) - 1
    points = tuple(Point(100.0 * k / last, value) for k, value in enumerate(part.curve))
    return line_chart(
        (Series("memory", points),),
        x_label="per cent of the run",
        y_label="MiB",
        description=f"Memory of the last process: {part.curve[0]:.0f} MiB after its first "
        f"round, {part.curve[-1]:.0f} MiB after its last.",
    )
