"""The chart of repeated timings: one row a renderer, on a linear axis from zero."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from markupsafe import Markup

from reports import svg
from reports.axes import LinearAxis, tick_text
from reports.svg import Series

ROW_HEIGHT = 52.0  # [px]
TOP = 8.0


def timings_chart(series: Sequence[Series], *, x_label: str, description: str) -> Markup:
    """Draw every repeat as a dot and the median as a bar.

    Parameters
    ----------
    series
        The x of every point is one repeat, >= 0 and finite; y is not looked at.
    x_label
        What the axis means.
    description
        What the chart shows, for a screen reader.

    Raises
    ------
    ValueError
        If no time is above 0.
    """
    times = [point.x for one in series for point in one.points]
    if not times or max(times) <= 0.0:
        raise ValueError("a chart of timings needs at least one time above 0")
    bottom = TOP + ROW_HEIGHT * len(series)
    axis = LinearAxis(max(times) * 1.08, 16.0, svg.WIDTH - svg.RIGHT)
    parts = []
    for tick in axis.ticks():
        x = axis.position(tick)
        parts.append(svg.line("grid", (x, TOP), (x, bottom)))
        parts.append(svg.text("tick", x, bottom + 17.0, tick_text(tick), "middle"))
    middle = (axis.start + axis.stop) / 2.0
    parts.append(svg.text("axis", middle, bottom + 38.0, x_label, "middle"))
    for index, one in enumerate(series):
        parts.append(_row(one, index, TOP + ROW_HEIGHT * index, axis))
    return svg.drawing(parts, bottom + svg.BOTTOM, description)


def _row(one: Series, index: int, top: float, axis: LinearAxis) -> Markup:
    y = top + 34.0
    parts = [svg.text("legend", axis.start + 5.0, top + 17.0, one.name)]
    if one.points:
        median = axis.position(statistics.median(point.x for point in one.points))
        parts.append(svg.line("median", (median, y - 10.0), (median, y + 10.0)))
    for point in one.points:
        parts.append(svg.marker(index, axis.position(point.x), y, point.tooltip))
    return svg.series_group(index, parts)
