"""Charts with two logarithmic axes (speed against accuracy, growth), as inline SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from reports import svg
from reports.axes import LogAxis, tick_text
from reports.svg import Series

PLOT_HEIGHT = 270.0  # [px]
LEGEND_ROW = 22.0  # [px]


def log_log_chart(
    series: Sequence[Series],
    *,
    x_label: str,
    y_label: str,
    description: str,
    guide_slope: float | None = -0.5,
) -> Markup:
    """Draw series over two logarithmic axes, with a faint guide of the given slope.

    Parameters
    ----------
    series
        At least one point in all; every coordinate finite and above 0.
    x_label, y_label
        What the axes mean.
    description
        What the chart shows, for a screen reader.
    guide_slope
        Exponent p < 0 of the guide y = c x^p; -1/2 is the law of independent samples.
        None draws no guide.

    Returns
    -------
    Markup
        An `<svg>` element without outside references.

    Raises
    ------
    ValueError
        If there is no point, or one that has no logarithm.
    """
    series = [one for one in series if one.points]
    points = [point for one in series for point in one.points]
    if not points:
        raise ValueError("a chart needs at least one point")
    for point in points:
        if not (0.0 < point.x < math.inf and 0.0 < point.y < math.inf):
            raise ValueError(f"({point.x}, {point.y}) has no place on logarithmic axes")
    keys, top = legend([one.name for one in series])
    bottom = top + PLOT_HEIGHT
    x_axis = LogAxis.around([point.x for point in points], svg.LEFT, svg.WIDTH - svg.RIGHT)
    y_axis = LogAxis.around([point.y for point in points], bottom, top)
    middle = (svg.LEFT + svg.WIDTH - svg.RIGHT) / 2.0
    parts = [
        *_grid(x_axis, y_axis),
        svg.text("axis", middle, bottom + 38.0, x_label, "middle"),
        _upright_title(y_label, (top + bottom) / 2.0),
    ]
    if guide_slope is not None:
        parts.append(_guide(series, guide_slope, x_axis, y_axis))
    for index, (one, side) in enumerate(zip(series, _label_sides(series), strict=True)):
        parts.append(_curve(one, index, side, x_axis, y_axis))
    return svg.drawing([*parts, keys], bottom + svg.BOTTOM, description)


def _grid(x_axis: LogAxis, y_axis: LogAxis) -> list[Markup]:
    parts = []
    for css, xs, ys in (
        ("minor", x_axis.minor_ticks(), y_axis.minor_ticks()),
        ("grid", x_axis.ticks(), y_axis.ticks()),
    ):
        for x in map(x_axis.position, xs):
            parts.append(svg.line(css, (x, y_axis.start), (x, y_axis.stop)))
        for y in map(y_axis.position, ys):
            parts.append(svg.line(css, (x_axis.start, y), (x_axis.stop, y)))
    for value in x_axis.ticks():
        x = x_axis.position(value)
        parts.append(svg.text("tick", x, y_axis.start + 17.0, tick_text(value), "middle"))
    for value in y_axis.ticks():
        y = y_axis.position(value)
        parts.append(svg.text("tick", x_axis.start - 7.0, y + 4.0, tick_text(value), "end"))
    return parts


def _upright_title(title: str, y: float) -> Markup:
    return Markup(
        '<text class="axis" transform="translate(13 {:.2f}) rotate(-90)"'
        ' text-anchor="middle">{}</text>'
    ).format(y, title)


def _guide(
    series: Sequence[Series], slope: float, x_axis: LogAxis, y_axis: LogAxis
) -> Markup:
    """Draw y = c x^slope through the geometric middle of all points, cut at the frame."""
    points = [point for one in series for point in one.points]
    constant = math.exp(
        sum(math.log(point.y) - slope * math.log(point.x) for point in points) / len(points)
    )
    # The guide falls, so it enters the frame at the left or the top and leaves it at the
    # right or the bottom.
    enters = max(x_axis.low, (y_axis.high / constant) ** (1.0 / slope))
    leaves = min(x_axis.high, (y_axis.low / constant) ** (1.0 / slope))
    if enters >= leaves:
        return Markup("")
    start, end = (
        (x_axis.position(x), y_axis.position(constant * x**slope)) for x in (enters, leaves)
    )
    return svg.line("guide", start, end)


def _label_sides(series: Sequence[Series]) -> list[int]:
    """Return -1 (labels below left), 1 (above right) or 0 (none, tooltips tell) per series.

    The lowest curve is labelled towards the origin and the highest away from it, so labels
    of neighbouring curves do not meet.
    """
    heights = [
        sum(math.log(point.y) + 0.5 * math.log(point.x) for point in one.points)
        / len(one.points)
        for one in series
    ]
    order = sorted(range(len(series)), key=heights.__getitem__)
    sides = [0] * len(series)
    sides[order[-1]] = 1
    sides[order[0]] = -1
    return sides


def _curve(one: Series, index: int, side: int, x_axis: LogAxis, y_axis: LogAxis) -> Markup:
    places = [(x_axis.position(point.x), y_axis.position(point.y)) for point in one.points]
    parts = [svg.polyline(index, places)]
    for point, (x, y) in zip(one.points, places, strict=True):
        parts.append(svg.marker(index, x, y, point.tooltip or one.name))
        if side and point.label:
            below = side < 0
            anchor = "end" if below else "start"
            shift = 15.0 if below else -7.0
            parts.append(svg.text("label", x + 6.0 * side, y + shift, point.label, anchor))
    return svg.series_group(index, parts)


def legend(names: Sequence[str]) -> tuple[Markup, float]:
    """Return the legend and where the plot below it begins; full rows wrap."""
    x, y = svg.LEFT, 16.0
    parts = []
    for index, name in enumerate(names):
        width = 30.0 + svg.LETTER * len(name)
        if x > svg.LEFT and x + width > svg.WIDTH:
            x, y = svg.LEFT, y + LEGEND_ROW
        key = [
            svg.polyline(index, [(x, y), (x + 24.0, y)]),
            svg.marker(index, x + 12.0, y, ""),
            svg.text("legend", x + 30.0, y + 4.0, name),
        ]
        parts.append(svg.series_group(index, key))
        x += width + 14.0
    return svg.joined(parts), y + LEGEND_ROW
