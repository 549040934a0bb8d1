"""A chart on a page: a plotly figure in the page's look, as an element that waits for it.

The element holds the figure as data; the script of `library` draws all of them. Each
series has a marker of its own, and a dash among six, so nothing depends on colour alone.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup

# at least 3:1 next to the page's light and its dark background
COLOURS = ("#0a8a7b", "#b8478a", "#7b8087", "#9a7b0a", "#3f7fc4", "#c2622c")
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
SYMBOLS = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross")
FILLINGS = ("", "-open", "-dot", "-open-dot")  # of the symbols of series 0, 6, 12, 18 on
GRID, FAINT, GUIDE = "rgba(128,134,140,.35)", "rgba(128,134,140,.13)", "rgb(128,134,140)"


@dataclass(frozen=True)
class Point:
    """One measurement; `label` is drawn next to it, `tooltip` shown on hover."""

    x: float
    y: float
    label: str = ""
    tooltip: str = ""
    x_range: tuple[float, float] | None = None  # where it may as well be, as a bar
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Series:
    """Points of one method, in their order."""

    name: str
    points: tuple[Point, ...]
    look: int | None = None  # colour, marker and dash; None: those of its place
    connected: bool = True  # by a line
    colour: int | None = None  # and dash, in place of those of `look`
    visible: bool = True  # from the start; else by a click on its name in the legend


def plain(text: str) -> str:
    """Return the text such that plotly, which knows some HTML, shows it as it stands."""
    return html.escape(text, quote=False)


def marks(series: int, name: str, hue: int | None = None, **given: Any) -> go.Scatter:
    """Return a trace with the colour, marker and dash of series number `series`.

    `hue` is the number of another colour and dash.
    """
    hue = series if hue is None else hue
    colour = COLOURS[hue % len(COLOURS)]
    filling = FILLINGS[series // len(SYMBOLS) % len(FILLINGS)]
    symbol = SYMBOLS[series % len(SYMBOLS)] + filling
    return go.Scatter(
        name=plain(name),
        legendgroup=name,
        hovertemplate="%{hovertext}<extra></extra>",
        cliponaxis=False,  # a mark at 0 is whole
        line={"color": colour, "dash": DASHES[hue % len(DASHES)], "width": 2},
        marker={"color": colour, "symbol": symbol, "size": 9},
        **given,
    )


def bars(
    ranges: Sequence[tuple[float, tuple[float, float] | None]],
) -> dict[str, object] | None:
    """Return the bars around values, from the low to the high end of each range."""
    if not any(ends for _, ends in ranges):
        return None
    ends = [(value, given or (value, value)) for value, given in ranges]
    return {
        "type": "data",
        "symmetric": False,
        "array": [high - value for value, (_, high) in ends],
        "arrayminus": [value - low for value, (low, _) in ends],
        "thickness": 1,
        "width": 3,
    }


def linear_axis(title: str = "", **given: Any) -> dict[str, Any]:
    """Return an axis on which equal differences are equal lengths."""
    return {"title": {"text": plain(title)}, "gridcolor": GRID, "zeroline": False, **given}


def log_axis(title: str, values: Sequence[float] = (), **given: Any) -> dict[str, Any]:
    """Return an axis on which equal ratios are equal lengths; its range is of exponents.

    Where `values` span less than three powers of ten, it has ticks at 1, 2 and 5 times.
    """
    if values and max(values) < 1e3 * min(values):
        given = {"dtick": "D2", **given}
    faint = {"showgrid": True, "gridcolor": FAINT, "dtick": "D1"}
    large = values and min(values) >= 1.0 and max(values) >= 1e4  # 20k takes less room
    shown = {"type": "log", "tickformat": "~s" if large else "~g", "minor": faint}
    return linear_axis(title, **shown, **given)


def category_axis(
    names: Sequence[str], first_on_top: bool = False, **given: Any
) -> dict[str, Any]:
    """Return an axis with a place for each name, in their order, used or not."""
    ends = (len(names) - 0.5, -0.5) if first_on_top else (-0.5, len(names) - 0.5)
    given |= {"type": "category", "categoryorder": "array", "range": ends}
    return linear_axis(categoryarray=list(names), **given)


def element(
    traces: Sequence[Any],
    *,
    x: dict[str, Any],
    y: dict[str, Any],
    height: int,
    description: str,
    **layout: Any,
) -> Markup:
    """Return the element that the script draws a chart in.

    Parameters
    ----------
    traces
        What plotly draws, the first at the bottom.
    x, y
        The axes.
    height
        In pixels; the width is that of the page.
    description
        What the chart shows, for a screen reader, and where no script runs.
    **layout
        Further settings of plotly's layout.
    """
    figure = go.Figure(
        list(traces),
        {
            "template": "none",
            "font": {"family": "system-ui, sans-serif"},
            "height": height,
            "margin": {"l": 68, "r": 14, "t": 34, "b": 52},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "legend": {"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom"},
            "xaxis": x,
            "yaxis": y,
            **layout,
        },
    )
    return Markup(
        '<div class="chart" role="img" aria-label="{}" style="min-height: {}px"'
        ' data-figure="{}"><noscript>{}</noscript></div>'
    ).format(description, height, figure.to_json(), description)
