"""Bars of counted values with the expected counts as a line over them, as inline SVG."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from reports import svg
from reports.axes import LinearAxis, tick_text

PLOT_HEIGHT = 170.0  # [px]
TOP = 30.0  # [px], room for the legend


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
    first, last = bins[0].low, bins[-1].high
    bottom = TOP + PLOT_HEIGHT
    most = max(max(one.count, one.expected) for one in bins) or 1.0
    heights = LinearAxis(1.08 * most, bottom, TOP)
    widths = LinearAxis(last - first, svg.LEFT, svg.WIDTH - svg.RIGHT)

    def across(value: float) -> float:
        return widths.position(value - first)

    middle = (svg.LEFT + svg.WIDTH - svg.RIGHT) / 2.0
    parts = [*_grid(heights, widths)]
    for tick in x_ticks:
        parts.append(svg.text("tick", across(tick), bottom + 17.0, f"{tick:g}", "middle"))
    parts.append(svg.text("axis", middle, bottom + 38.0, x_label, "middle"))
    parts.append(svg.series_group(0, [_bar(one, across, heights) for one in bins]))
    line = [
        (across((one.low + one.high) / 2.0), heights.position(one.expected)) for one in bins
    ]
    # A bin is a step, so a level line reaches both ends of the axis.
    line = [(across(first), line[0][1]), *line, (across(last), line[-1][1])]
    parts.append(svg.series_group(1, [svg.polyline(1, line)]))
    return svg.drawing([*parts, *_legend()], bottom + svg.BOTTOM, description)


def _grid(heights: LinearAxis, widths: LinearAxis) -> list[Markup]:
    parts = []
    for tick in heights.ticks():
        y = heights.position(tick)
        parts.append(svg.line("grid", (widths.start, y), (widths.stop, y)))
        parts.append(svg.text("tick", widths.start - 7.0, y + 4.0, tick_text(tick), "end"))
    return parts


def _bar(one: Bin, across: Callable[[float], float], heights: LinearAxis) -> Markup:
    left, right = across(one.low), across(one.high)
    top = heights.position(one.count)
    said = f"{one.low:.3g} to {one.high:.3g}: {one.count:.0f}, expected {one.expected:.1f}"
    return svg.bar(left + 0.5, top, right - left - 1.0, heights.start - top, said)


def _legend() -> list[Markup]:
    y = 14.0
    expected = [
        svg.polyline(1, [(svg.LEFT + 100.0, y), (svg.LEFT + 124.0, y)]),
        svg.text("legend", svg.LEFT + 130.0, y + 4.0, "expected if nothing differs"),
    ]
    counted = [
        svg.bar(svg.LEFT, y - 5.0, 16.0, 10.0, ""),
        svg.text("legend", svg.LEFT + 22.0, y + 4.0, "counted"),
    ]
    return [svg.series_group(0, counted), svg.series_group(1, expected)]
