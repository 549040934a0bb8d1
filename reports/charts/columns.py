"""Columns: counted values and expected ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go
from markupsafe import Markup

from reports.charts.figure import (
    COLOURS,
    element,
    linear_axis,
    marks,
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
