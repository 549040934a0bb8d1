"""A curve that leaves a tolerance: where it is crossed, and what is no number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup

from reports.charts.figure import (
    GUIDE,
    Point,
    element,
    linear_axis,
    log_axis,
    marks,
    plain,
)

HEIGHT = 260  # [px]
WIDE = 20.0  # ratio of ends from which on an axis is logarithmic
POWERS = {"exponentformat": "power"}  # 10^-9, not 1n
BAND = "rgba(194,98,44,.18)"


def boundary_chart(
    curve: Sequence[tuple[float, float | None]],
    *,
    tolerance: float,
    boundary: tuple[float, float | None],
    x_label: str,
    y_label: str,
    description: str,
) -> Markup:
    """Draw what was measured over a stress, the tolerance, and where it is left.

    Parameters
    ----------
    curve
        (x, y) with growing x; y None is no finite number and drawn at the top. Where the
        axis is logarithmic, 0 is drawn at the bottom.
    tolerance
        A dotted line.
    boundary
        The x up to which, and from which on; None: nowhere.
    x_label, y_label
        What the axes mean.
    description
        What the chart shows, for a screen reader.

    Raises
    ------
    ValueError
        If there is nothing to draw.
    """
    if not curve:
        raise ValueError("a chart needs at least one point")
    xs = [x for x, _ in curve]
    positive = [y for _, y in curve if y is not None and y > 0.0]
    positive += [tolerance] if tolerance > 0.0 else []
    log_x = min(xs) > 0.0 and max(xs) > WIDE * min(xs)
    log_y = bool(positive) and max(positive) > WIDE * min(positive)
    bottom = min(positive) / 10.0 if log_y else 0.0
    top = max(positive, default=1.0) * (10.0 if log_y else 1.1)
    points = [_placed(x, y, bottom, top) for x, y in curve]
    line = marks(
        0,
        "measured",
        mode="lines+markers+text",
        x=[point.x for point in points],
        y=[point.y for point in points],
        text=[point.label for point in points],
        textposition="top center",
        hovertext=[plain(point.tooltip) for point in points],
        showlegend=False,
    )
    traces: list[Any] = [line]
    if tolerance > 0.0:
        level = {"color": GUIDE, "dash": "dot", "width": 1.2}
        ends = [min(xs), max(xs)]
        traces.insert(
            0,
            go.Scatter(
                x=ends,
                y=[tolerance, tolerance],
                mode="lines",
                line=level,
                hoverinfo="skip",
                showlegend=False,
            ),
        )
    y_range = [-0.08 * top, 1.05 * top]
    if log_y:  # whole markers at both ends
        y_range = [math.log10(bottom / 2.0), math.log10(top * 3.0)]
    return element(
        traces,
        x=log_axis(x_label) if log_x else linear_axis(x_label, **POWERS),
        y=(
            log_axis(y_label, range=y_range)
            if log_y
            else linear_axis(y_label, range=y_range, **POWERS)
        ),
        height=HEIGHT,
        description=description,
        shapes=_band(boundary),
    )


def _placed(x: float, y: float | None, bottom: float, top: float) -> Point:
    if y is None:
        return Point(x, top, "no number", f"{x:g}: no finite number")
    zero = y <= 0.0 < bottom
    return Point(x, bottom if zero else y, "0" if zero else "", f"{x:g}: {y:.3g}")


def _band(boundary: tuple[float, float | None]) -> list[dict[str, Any]]:
    """Return the strip between where a method holds and where it fails."""
    low, high = boundary
    if high is None:
        return []
    edge = {"color": BAND, "width": 3}  # a narrow strip would not be seen
    place = {"x0": low, "x1": high, "y0": 0, "y1": 1, "yref": "paper"}
    return [{"type": "rect", **place, "fillcolor": BAND, "line": edge, "layer": "below"}]
