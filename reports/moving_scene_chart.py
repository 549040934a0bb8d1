"""The chart of moving scenes: what refitting costs the rays, over the way that is gone."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from reports import svg
from reports.axes import LinearAxis, LogAxis, tick_text
from reports.svg import Series

HEIGHT = 230.0  # [px] of the plot
TOP = 30.0  # the legend is above


def progress_chart(series: Sequence[Series], *, y_label: str, description: str) -> Markup:
    """Draw ratios over the progress of motions, in per cent; the ratio is logarithmic.

    Parameters
    ----------
    series
        One a motion, at least one point each: x from 0 to 100, y finite and above 0.
    y_label
        What the ratio is of.
    description
        What the chart shows, for a screen reader.

    Returns
    -------
    Markup
        An `<svg>` element without outside references.

    Raises
    ------
    ValueError
        If there is nothing to draw, or a ratio that has no logarithm.
    """
    ratios = [point.y for one in series for point in one.points]
    if not ratios:
        raise ValueError("a chart needs at least one point")
    if not all(0.0 < ratio < math.inf for ratio in ratios):
        raise ValueError(f"ratios are finite and above 0: {min(ratios)} to {max(ratios)}")
    bottom = TOP + HEIGHT
    x_axis = LinearAxis(100.0, svg.LEFT, svg.WIDTH - svg.RIGHT)
    # with 1, at which both ways cost the same, in view
    y_axis = LogAxis.around([*ratios, 1.0], bottom, TOP)
    level = y_axis.position(1.0)
    middle = (x_axis.start + x_axis.stop) / 2.0
    parts = [
        *_grid(x_axis, y_axis),
        svg.line("guide", (x_axis.start, level), (x_axis.stop, level)),
        svg.text("axis", middle, bottom + 38.0, "per cent of the motion", "middle"),
        Markup(
            '<text class="axis" transform="translate(13 {:.2f}) rotate(-90)"'
            ' text-anchor="middle">{}</text>'
        ).format((TOP + bottom) / 2.0, y_label),
    ]
    for index, one in enumerate(series):
        places = [(x_axis.position(p.x), y_axis.position(p.y)) for p in one.points]
        marks = [
            svg.marker(index, *place, point.tooltip or one.name)
            for place, point in zip(places, one.points, strict=True)
        ]
        parts.append(svg.series_group(index, [svg.polyline(index, places), *marks]))
    parts.append(_legend([one.name for one in series]))
    return svg.drawing(parts, bottom + svg.BOTTOM, description)


def _grid(x_axis: LinearAxis, y_axis: LogAxis) -> list[Markup]:
    parts = []
    for tick in x_axis.ticks():
        x = x_axis.position(tick)
        parts.append(svg.line("grid", (x, y_axis.start), (x, y_axis.stop)))
        parts.append(svg.text("tick", x, y_axis.start + 17.0, tick_text(tick), "middle"))
    for tick in y_axis.ticks():
        y = y_axis.position(tick)
        parts.append(svg.line("grid", (x_axis.start, y), (x_axis.stop, y)))
        parts.append(svg.text("tick", x_axis.start - 7.0, y + 4.0, tick_text(tick), "end"))
    return parts


def _legend(names: Sequence[str]) -> Markup:
    """Return one row with a key for each name."""
    x, y = svg.LEFT, 12.0
    parts = []
    for index, name in enumerate(names):
        key = [
            svg.polyline(index, [(x, y), (x + 24.0, y)]),
            svg.marker(index, x + 12.0, y, ""),
            svg.text("legend", x + 30.0, y + 4.0, name),
        ]
        parts.append(svg.series_group(index, key))
        x += 44.0 + svg.LETTER * len(name)
    return svg.joined(parts)
