"""Curves that leave a tolerance: where it is crossed, and what is not finite."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup

from reports.charts.figure import (
    COLOURS,
    GUIDE,
    Point,
    element,
    linear_axis,
    log_axis,
    marks,
    plain,
)

HEIGHT = 300  # [px]
WIDE = 20.0  # ratio of ends from which on an axis is logarithmic
POWERS = {"exponentformat": "power"}  # 10^-9, not 1n


@dataclass(frozen=True)
class BoundedCurve:
    """What was measured of one method; the interval in which it leaves the tolerance.

    A y of None is not a finite number.
    """

    name: str
    points: Sequence[tuple[float, float | None]]
    boundary: tuple[float, float] | None = None


def boundary_chart(
    curves: Sequence[BoundedCurve],
    *,
    tolerance: float,
    x_label: str,
    y_label: str,
    description: str,
) -> Markup:
    """Draw curves over a stress, the tolerance, and where each curve leaves it.

    There is no legend: the page has the names, with the marks of `figure` in their order.

    Parameters
    ----------
    curves
        With growing x. Points that are not finite are drawn at the top; where the axis is
        logarithmic, 0 is drawn at the bottom.
    tolerance
        A dotted line.
    x_label, y_label
        What the axes mean.
    description
        What the chart shows, for a screen reader.

    Raises
    ------
    ValueError
        If there is nothing to draw.
    """
    places = [point for curve in curves for point in curve.points]
    if not places:
        raise ValueError("a chart needs at least one point")
    xs = [x for x, _ in places]
    positive = [y for _, y in places if y is not None and y > 0.0]
    positive += [tolerance] if tolerance > 0.0 else []
    log_x = min(xs) > 0.0 and max(xs) > WIDE * min(xs)
    log_y = bool(positive) and max(positive) > WIDE * min(positive)
    bottom = min(positive) / 10.0 if log_y else 0.0
    top = max(positive, default=1.0) * (10.0 if log_y else 1.1)
    traces: list[Any] = []
    if tolerance > 0.0:
        level = {"color": GUIDE, "dash": "dot", "width": 1.2}
        ends = [min(xs), max(xs)]
        traces.append(
            go.Scatter(
                x=ends, y=[tolerance] * 2, mode="lines", line=level, hoverinfo="skip"
            )
        )
    seen: set[str] = set()  # labels: one zero is enough to tell
    for number, curve in enumerate(curves):
        points = [_placed(curve.name, x, y, bottom, top) for x, y in curve.points]
        traces.append(
            marks(
                number,
                curve.name,
                mode="lines+markers+text",
                x=[point.x for point in points],
                y=[point.y for point in points],
                text=[_once(point.label, seen) for point in points],
                textposition="top center",
                hovertext=[plain(point.tooltip) for point in points],
            )
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
        showlegend=False,
        shapes=[
            _band(curve.boundary, COLOURS[number % len(COLOURS)])
            for number, curve in enumerate(curves)
            if curve.boundary is not None
        ],
    )


def _once(label: str, seen: set[str]) -> str:
    new = label not in seen
    seen.add(label)
    return label if new else ""


def _placed(name: str, x: float, y: float | None, bottom: float, top: float) -> Point:
    if y is None:
        return Point(x, top, "no number", f"{name}, at {x:g}: no finite number")
    zero = y <= 0.0 < bottom
    label = "0" if zero else ""
    return Point(x, bottom if zero else y, label, f"{name}, at {x:g}: {y:.3g}")


def _band(boundary: tuple[float, float], colour: str) -> dict[str, Any]:
    """Return the strip between where a method holds and where it fails."""
    edge = {"color": colour, "width": 3}  # a narrow strip would not be seen
    place = {"x0": boundary[0], "x1": boundary[1], "y0": 0, "y1": 1, "yref": "paper"}
    look = {"fillcolor": colour, "line": edge, "opacity": 0.2, "layer": "below"}
    return {"type": "rect", **place, **look}
