"""Curves over two axes: speed against accuracy, growth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup

from reports.charts.figure import (
    GUIDE,
    Point,
    Series,
    bars,
    element,
    linear_axis,
    log_axis,
    marks,
    plain,
)

HEIGHT = 360  # [px]
FRONT = "rgba(240,170,20,.5)"


def log_log_chart(
    series: Sequence[Series],
    *,
    x_label: str,
    y_label: str,
    description: str,
    guide_slope: float | None = -0.5,
    front: Sequence[tuple[float, float]] = (),
    height: int = HEIGHT,
) -> Markup:
    """Draw series over two logarithmic axes, with a dotted guide of the given slope.

    Parameters
    ----------
    series
        At least one point in all; every coordinate finite and above 0.
    x_label, y_label
        What the axes mean.
    description
        What the chart shows, for a screen reader.
    guide_slope
        Exponent p of the guide y = c x^p; -1/2 is the law of independent samples. None
        draws no guide.
    front
        Places (x, y) of the points that no other beats in both, by x; marked by a broad
        staircase behind all curves.
    height
        In pixels.

    Raises
    ------
    ValueError
        If there is no point, or one that has no logarithm.
    """
    points = _checked(series)
    traces = _curves(series)
    if guide_slope is not None:
        # through the geometric middle of all points
        shift = sum(math.log(p.y) - guide_slope * math.log(p.x) for p in points)
        ends = sorted({min(p.x for p in points), max(p.x for p in points)})
        heights = [math.exp(shift / len(points)) * x**guide_slope for x in ends]
        traces.insert(0, _guide(ends, heights))
    if front:
        traces.insert(0, _front(front))
    x = log_axis(x_label, [point.x for point in points])
    y = log_axis(y_label, [point.y for point in points], automargin=True)
    return element(traces, x=x, y=y, height=height, description=description)


def line_chart(
    series: Sequence[Series], *, x_label: str, y_label: str, description: str, **x: Any
) -> Markup:
    """Draw series over two linear axes.

    Parameters
    ----------
    series
        Every coordinate finite.
    x_label, y_label, description
        What the axes mean; what the chart shows, for a screen reader.
    **x
        Further settings of plotly's first axis.

    Raises
    ------
    ValueError
        If there is nothing to draw.
    """
    points = [point for one in series for point in one.points]
    if not points or not all(math.isfinite(p.x) and math.isfinite(p.y) for p in points):
        raise ValueError("a chart needs at least one point, and finite ones")
    axes = linear_axis(x_label, **x), linear_axis(y_label, rangemode="tozero")
    return element(
        _curves(series), x=axes[0], y=axes[1], height=HEIGHT, description=description
    )


def _checked(series: Sequence[Series]) -> list[Point]:
    points = [point for one in series for point in one.points]
    if not points:
        raise ValueError("a chart needs at least one point")
    for point in points:
        if not (0.0 < point.x < math.inf and 0.0 < point.y < math.inf):
            raise ValueError(f"({point.x}, {point.y}) has no place on logarithmic axes")
    return points


def _curves(series: Sequence[Series]) -> list[go.Scatter]:
    drawn = [one for one in series if one.points]
    return [
        marks(
            index if one.look is None else one.look,
            one.name,
            one.colour,
            visible=True if one.visible else "legendonly",
            mode="lines+markers+text" if one.connected else "markers+text",
            x=[point.x for point in one.points],
            y=[point.y for point in one.points],
            text=[plain(point.label) for point in one.points],
            # the first series, ours, is mostly the lower one
            textposition="top right" if index else "bottom left",
            hovertext=[plain(point.tooltip or one.name) for point in one.points],
            error_x=bars([(point.x, point.x_range) for point in one.points]),
            error_y=bars([(point.y, point.y_range) for point in one.points]),
        )
        for index, one in enumerate(drawn)
    ]


def _front(places: Sequence[tuple[float, float]]) -> go.Scatter:
    x, y = zip(*places, strict=True)
    line = {"color": FRONT, "width": 9, "shape": "hv"}
    name = "Pareto front"
    return go.Scatter(x=x, y=y, name=name, mode="lines", line=line, hoverinfo="skip")


def _guide(x: list[float], y: list[float]) -> go.Scatter:
    line = {"color": GUIDE, "dash": "dot", "width": 1.2}
    return go.Scatter(x=x, y=y, mode="lines", line=line, hoverinfo="skip", showlegend=False)
