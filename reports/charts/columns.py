"""Columns: counted values beside expected ones, and values of a few kinds of things."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go
from markupsafe import Markup

from reports.charts.figure import (
    COLOURS,
    Series,
    category_axis,
    element,
    linear_axis,
    log_axis,
    marks,
    plain,
)

HEIGHT = 300  # [px]


@dataclass(frozen=True)
class Bin:
    """Values from `low` to `high`."""

    low: float
    high: float
    count: float
    expected: float


def histogram_chart(
    bins: Sequence[Bin], *, x_ticks: Sequence[float], x_label: str, description: str
) -> Markup:
    """Draw counts as bars and what chance alone would give as a line.

    Parameters
    ----------
    bins
        From left to right, without gaps, at least one.
    x_ticks
        Values that get a label.
    x_label, description
        What the axis means; what the chart shows, for a screen reader.
    """
    middles = [(one.low + one.high) / 2.0 for one in bins]
    counted = go.Bar(
        name="counted",
        x=middles,
        y=[one.count for one in bins],
        width=[0.92 * (one.high - one.low) for one in bins],
        marker={"color": COLOURS[0], "opacity": 0.5},
        hovertemplate="%{hovertext}<extra></extra>",
        hovertext=[
            f"{one.low:.3g} to {one.high:.3g}: {one.count:.0f}, expected {one.expected:.1f}"
            for one in bins
        ],
    )
    expected = marks(
        1,
        "expected if nothing differs",
        mode="lines",
        # A bin is a step, so a level line reaches both ends of the axis.
        x=[bins[0].low, *middles, bins[-1].high],
        y=[one.expected for one in (bins[0], *bins, bins[-1])],
        hoverinfo="skip",
    )
    expected.hovertemplate = None
    return element(
        [counted, expected],
        x=linear_axis(x_label, tickvals=list(x_ticks)),
        y=linear_axis(rangemode="tozero"),
        height=HEIGHT,
        description=description,
    )


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
    y_label, description
        What the logarithmic axis means; what the chart shows, for a screen reader.

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
    titles = [f"{plain(name)}<br>{plain(note)}" for name, note in columns]
    traces = [
        marks(
            index,
            one.name,
            mode="markers",
            x=[titles[int(point.x)] for point in one.points],
            y=[point.y for point in one.points],
            hovertext=[plain(point.tooltip or one.name) for point in one.points],
        )
        for index, one in enumerate(series)
    ]
    highest = math.log10(1.3 * max(2.0, *(point.y for point in points)))
    return element(
        traces,
        x=category_axis(titles),
        # from 1: nothing is let through that does not hit
        y=log_axis(y_label, range=[math.log10(0.93), highest]),
        height=HEIGHT,
        description=description,
        scattermode="group",  # side by side, so that equal heights do not hide each other
    )
