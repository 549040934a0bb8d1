"""A row of dots for each contender on one logarithmic axis, one kind of dot a series."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from reports import svg
from reports.axes import LogAxis, tick_text
from reports.charts import LEGEND_ROW, legend

ROW_HEIGHT = 21.0  # [px]
NAMES_WIDTH = 150.0  # [px]


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
    keys, top = legend(series)
    top -= LEGEND_ROW / 4.0
    bottom = top + ROW_HEIGHT * len(rows)
    axis = LogAxis.around(values, NAMES_WIDTH, svg.WIDTH - svg.RIGHT, 1.3)
    parts = []
    for css, ticks in (("minor", axis.minor_ticks()), ("grid", axis.ticks())):
        for x in map(axis.position, ticks):
            parts.append(svg.line(css, (x, top), (x, bottom)))
    for tick in axis.ticks():
        place = axis.position(tick)
        parts.append(svg.text("tick", place, bottom + 17.0, tick_text(tick), "middle"))
    middle = (axis.start + axis.stop) / 2.0
    parts.append(svg.text("axis", middle, bottom + 38.0, x_label, "middle"))
    for number, (name, _) in enumerate(rows):
        y = top + ROW_HEIGHT * (number + 0.5)
        parts.append(svg.line("minor", (axis.start, y), (axis.stop, y)))
        parts.append(svg.text("label-row", NAMES_WIDTH - 8.0, y + 4.0, name, "end"))
    for index, one in enumerate(series):
        parts.append(svg.series_group(index, _dots(rows, one, index, top, axis)))
    return svg.drawing([*parts, keys], bottom + svg.BOTTOM, description)


def _dots(
    rows: Sequence[tuple[str, Mapping[str, float]]],
    series: str,
    index: int,
    top: float,
    axis: LogAxis,
) -> list[Markup]:
    dots = []
    for number, (name, values) in enumerate(rows):
        if series in values:
            y = top + ROW_HEIGHT * (number + 0.5)
            said = f"{name}, {series}: {values[series]:.3g}"
            dots.append(svg.marker(index, axis.position(values[series]), y, said))
    return dots
