"""A row of dots for each contender: repeated timings, or several kinds of speed."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from reports.charts.figure import (
    GUIDE,
    Series,
    bars,
    category_axis,
    element,
    linear_axis,
    log_axis,
    marks,
    plain,
)

ROW = 24  # [px]
TIMED_ROW = 52  # [px], with room for the bar of the median
AROUND = 90  # [px] for legend and axis


def dots_chart(
    rows: Sequence[tuple[str, Mapping[str, float]]],
    series: Sequence[str],
    *,
    x_label: str,
    description: str,
) -> Markup:
    """Draw values of several series beside the name of each row.

    Parameters
    ----------
    rows
        (name, values by series); values finite and above 0, absent ones are not drawn.
    series
        Names, in the order of the legend.
    x_label, description
        What the axis means; what the chart shows, for a screen reader.

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
        traces.append(
            marks(
                index,
                one,
                mode="markers",
                x=[value for _, value in found],
                y=[plain(name) for name, _ in found],
                hovertext=[plain(f"{name}, {one}: {v:.3g}") for name, v in found],
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
    )


def ranked_chart(
    rows: Sequence[tuple[str, str, float, tuple[float, float], str, int]],
    *,
    x_label: str,
    description: str,
) -> Markup:
    """Draw a value with its interval beside each name, and a line at 1.

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
    line = {"type": "line", "x0": 1, "x1": 1, "y0": 0, "y1": 1, "yref": "paper"}
    return element(
        traces,
        x=log_axis(x_label),
        y=category_axis([plain(row[0]) for row in rows], True, automargin=True),
        height=AROUND + ROW * len(rows),
        description=description,
        shapes=[{**line, "line": {"color": GUIDE, "width": 2}}],
    )


def timings_chart(series: Sequence[Series], *, x_label: str, description: str) -> Markup:
    """Draw every repeat as a dot and the median as a bar, on a linear axis from zero.

    Parameters
    ----------
    series
        The x of every point is one repeat, >= 0 and finite; y is not looked at.
    x_label, description
        What the axis means; what the chart shows, for a screen reader.

    Raises
    ------
    ValueError
        If no time is above 0.
    """
    longest = max((point.x for one in series for point in one.points), default=0.0)
    if longest <= 0.0:
        raise ValueError("a chart of timings needs at least one time above 0")
    traces = []
    for index, one in enumerate(series):
        times = [point.x for point in one.points]
        dots = marks(
            index,
            one.name,
            mode="markers",
            x=times,
            y=[plain(one.name)] * len(times),
            hovertext=[plain(point.tooltip or one.name) for point in one.points],
        )
        traces.append(dots)
        if times:
            middle = statistics.median(times)
            bar = marks(
                index,
                f"median of {one.name}",
                mode="markers",
                x=[middle],
                y=[plain(one.name)],
                hovertext=[plain(f"{one.name}, median: {middle:.3g}")],
            )
            bar.marker.update(symbol="line-ns", size=26, line={"width": 3})
            bar.marker.line.color = dots.marker.color
            traces.append(bar)
    return element(
        traces,
        x=linear_axis(x_label, range=[0.0, 1.08 * longest]),
        y=category_axis(
            [plain(one.name) for one in series], first_on_top=True, automargin=True
        ),
        height=AROUND + TIMED_ROW * len(series),
        description=description,
        showlegend=False,
    )


def _names(names: Sequence[str]) -> dict[str, object]:
    names = [plain(name) for name in names]
    return category_axis(names, first_on_top=True, automargin=True)
