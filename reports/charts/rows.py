"""A row for each thing and a dot for each of its values, on a logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from reports.charts.figure import (
    GUIDE,
    bars,
    category_axis,
    element,
    log_axis,
    marks,
    plain,
)

ROW = 24  # [px]
AROUND = 90  # [px] for legend and axis


def dots_chart(
    rows: Sequence[tuple[str, Mapping[str, float]]],
    series: Sequence[str],
    *,
    x_label: str,
    description: str,
    intervals: Mapping[tuple[str, str], tuple[float, float]] | None = None,
    guide: float | None = None,
) -> Markup:
    """Draw values of several series next to the name of each row.

    Parameters
    ----------
    rows
        (name, values by series); values finite and above 0, absent ones are not drawn.
    series
        Names, in the order of the legend.
    x_label, description
        What the axis means; what the chart shows, for a screen reader.
    intervals
        Of values, by the names of row and series.
    guide
        Place of a dotted line through all rows.

    Raises
    ------
    ValueError
        If there is no value, or one that has no logarithm.
    """
    values = [value for _, given in rows for value in given.values()]
    if not values or not all(0.0 < value < math.inf for value in values):
        raise ValueError("a chart of dots needs finite values above 0")
    traces = []
    for index, one in enumerate(series):
        found = [(name, given[one]) for name, given in rows if one in given]
        ranges = [(value, (intervals or {}).get((name, one))) for name, value in found]
        traces.append(
            marks(
                index,
                one,
                mode="markers",
                x=[value for _, value in found],
                y=[plain(name) for name, _ in found],
                hovertext=[plain(f"{name}, {one}: {v:.3g}") for name, v in found],
                error_x=bars(ranges),
            )
        )
    return element(
        traces,
        x=log_axis(x_label),
        y=category_axis(
            [plain(name) for name, _ in rows], first_on_top=True, automargin=True
        ),
        height=AROUND + ROW * len(rows),
        description=description,
        showlegend=True,  # also of one series
        shapes=[] if guide is None else [_line(guide)],
    )


def _line(x: float) -> dict[str, object]:
    place = {"x0": x, "x1": x, "y0": 0, "y1": 1, "yref": "paper"}
    return {"type": "line", **place, "line": {"color": GUIDE, "dash": "dot", "width": 1.2}}


def ranked_chart(
    rows: Sequence[tuple[str, str, float, tuple[float, float], str, int]],
    *,
    x_label: str,
    description: str,
) -> Markup:
    """Draw a row for each name: its value with an interval, and a line at 1.

    Parameters
    ----------
    rows
        (name, series, value, interval, tooltip, colour), the first on top; values finite
        and above 0. A series has one colour.
    x_label, description
        What the axis means; what the chart shows, for a screen reader.
    """
    traces = []
    for index, series in enumerate(dict.fromkeys(row[1] for row in rows)):
        found = [row for row in rows if row[1] == series]
        trace = marks(
            index,
            series,
            found[0][5],
            mode="markers",
            x=[row[2] for row in found],
            y=[plain(row[0]) for row in found],
            hovertext=[plain(row[4]) for row in found],
            error_x=bars([(row[2], row[3]) for row in found]),
        )
        traces.append(trace)
    return element(
        traces,
        x=log_axis(x_label, side="top"),  # a long chart: its scale is seen first
        y=category_axis([plain(row[0]) for row in rows], True, automargin=True),
        height=AROUND + ROW * len(rows),
        description=description,
        legend={"orientation": "h", "x": 0, "y": -0.01, "yanchor": "top"},
        shapes=[_line(1.0)],
    )
