"""The chart of bounding volumes: a column each, how many rays it lets through upwards."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from reports import svg
from reports.axes import LogAxis, tick_text
from reports.svg import Series

PLOT_HEIGHT = 230.0  # [px]
LEGEND_ROW = 22.0  # [px]


def volumes_chart(
    columns: Sequence[tuple[str, str]],
    series: Sequence[Series],
    *,
    y_label: str,
    description: str,
) -> Markup:
    """Draw one column for each volume and one marker in it for each object.

    Parameters
    ----------
    columns
        Two short lines of text under each column.
    series
        One for each object; the x of a point is the number of its column, its y >= 1.
    y_label
        What the logarithmic axis means.
    description
        What the chart shows, for a screen reader.

    Raises
    ------
    ValueError
        If there is no point, or one that has no place.
    """
    points = [point for one in series for point in one.points]
    if not points:
        raise ValueError("a chart needs at least one point")
    for point in points:
        if point.x not in range(len(columns)) or not 1.0 <= point.y < math.inf:
            raise ValueError(
                f"({point.x}, {point.y}) has no place in {len(columns)} columns"
            )
    top = 8.0 + LEGEND_ROW
    bottom = top + PLOT_HEIGHT
    # from 1: nothing is let through that does not hit
    highest = 1.3 * max(2.0, *(point.y for point in points))
    y_axis = LogAxis(0.93, highest, bottom, top)
    width = (svg.WIDTH - svg.RIGHT - svg.LEFT) / len(columns)
    parts = [*_grid(y_axis, y_label), *_column_titles(columns, width, bottom)]
    x_legend = svg.LEFT
    for index, one in enumerate(series):
        key = [
            svg.marker(index, x_legend + 6.0, 16.0, ""),
            svg.text("legend", x_legend + 16.0, 20.0, one.name),
        ]
        parts.append(svg.series_group(index, key))
        x_legend += 30.0 + svg.LETTER * len(one.name)
        marks = []
        for point in one.points:
            # side by side, so that equal heights do not hide each other
            x = svg.LEFT + width * (point.x + (index + 1.0) / (len(series) + 1.0))
            y = y_axis.position(point.y)
            marks += [
                svg.line("median", (x, bottom), (x, y)),
                svg.marker(index, x, y, point.tooltip),
            ]
        parts.append(svg.series_group(index, marks))
    return svg.drawing(parts, bottom + svg.BOTTOM, description)


def _grid(y_axis: LogAxis, title: str) -> list[Markup]:
    parts = []
    left, right = svg.LEFT, svg.WIDTH - svg.RIGHT
    for value in y_axis.minor_ticks():
        y = y_axis.position(value)
        parts.append(svg.line("minor", (left, y), (right, y)))
    for value in y_axis.ticks():
        y = y_axis.position(value)
        parts.append(svg.line("grid", (left, y), (right, y)))
        parts.append(svg.text("tick", left - 7.0, y + 4.0, tick_text(value), "end"))
    middle = (y_axis.start + y_axis.stop) / 2.0
    upright = Markup(
        '<text class="axis" transform="translate(13 {:.2f}) rotate(-90)"'
        ' text-anchor="middle">{}</text>'
    )
    return [*parts, upright.format(middle, title)]


def _column_titles(
    columns: Sequence[tuple[str, str]], width: float, bottom: float
) -> list[Markup]:
    parts = []
    for index, (name, note) in enumerate(columns):
        x = svg.LEFT + width * (index + 0.5)
        parts.append(svg.text("tick", x, bottom + 17.0, name, "middle"))
        parts.append(svg.text("tick", x, bottom + 34.0, note, "middle"))
    return parts
