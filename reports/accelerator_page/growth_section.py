"""The study of growth as charts of a few curves each, and the laws that fit them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from markupsafe import Markup

from reports.accelerator_page.fits import Fit, logarithm_fit, power_fit
from reports.accelerator_study.record import Growth, GrowthPoint, GrowthSeries
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.look.formatting import number, seconds

CURVES = 4  # of structures in one chart, beside brute force
LEAST_POINTS = 3  # for a fit


@dataclass(frozen=True)
class Laws:
    """Two laws for one quantity; None where there are too few points."""

    power: Fit | None  # c n^p
    logarithm: Fit | None  # a + b log2 n


@dataclass(frozen=True)
class GrowthRow:
    """One structure in the table of fits."""

    name: str
    rays: dict[str, Laws]  # by kind
    build: Laws
    largest: GrowthPoint | None
    stopped: str


@dataclass(frozen=True)
class Panel:
    """Charts of one quantity."""

    title: str
    charts: tuple[Markup, ...]


@dataclass(frozen=True)
class GrowthSection:
    """Growth, ready to be drawn."""

    record: Growth
    panels: tuple[Panel, ...]
    rows: tuple[GrowthRow, ...]


def growth_section(growth: Growth, naive: str) -> GrowthSection:
    """Work out charts and fits."""
    panels = [
        _panel(
            growth,
            naive,
            f"{kind} rays",
            f"nanoseconds per {kind} ray, one thread",
            _ray_time(kind),
            lambda value: f"{number(value)} ns",
        )
        for kind in growth.kinds
    ]
    panels.append(
        _panel(growth, naive, "build", "build, seconds", lambda p: p.build_seconds, seconds)
    )
    return GrowthSection(
        growth,
        tuple(panel for panel in panels if panel.charts),
        tuple(_row(one, growth.kinds) for one in growth.series),
    )


def _ray_time(kind: str) -> Callable[[GrowthPoint], float]:
    return lambda point: point.nanoseconds.get(kind, 0.0)


def _row(one: GrowthSeries, kinds: tuple[str, ...]) -> GrowthRow:
    def laws(value: Callable[[GrowthPoint], float]) -> Laws:
        if len(one.points) < LEAST_POINTS:
            return Laws(None, None)
        sizes = [point.triangles for point in one.points]
        values = [value(point) for point in one.points]
        return Laws(power_fit(sizes, values), logarithm_fit(sizes, values))

    return GrowthRow(
        one.name,
        {kind: laws(_ray_time(kind)) for kind in kinds},
        laws(lambda point: point.build_seconds),
        one.points[-1] if one.points else None,
        one.stopped,
    )


def _panel(
    growth: Growth,
    naive: str,
    title: str,
    y_label: str,
    value: Callable[[GrowthPoint], float],
    shown: Callable[[float], str],
) -> Panel:
    """Draw a few structures to a chart, brute force in each, so that curves stay apart."""
    base = [one for one in growth.series if one.name == naive and one.points]
    rest = [one for one in growth.series if one.name != naive and one.points]
    charts = []
    count = max(1, -(-len(rest) // CURVES))
    cuts = [len(rest) * k // count for k in range(count + 1)]
    for first, end in pairwise(cuts):
        curves = [
            Series(one.name, _points(one, value, shown))
            for one in [*base, *rest[first:end]]
        ]
        if any(curve.points for curve in curves):
            charts.append(
                log_log_chart(
                    curves,
                    x_label="triangles",
                    y_label=y_label,
                    description=f"Growth with the number of triangles: {title}.",
                    guide_slope=None,
                )
            )
    return Panel(title, tuple(charts))


def _points(
    one: GrowthSeries, value: Callable[[GrowthPoint], float], shown: Callable[[float], str]
) -> tuple[Point, ...]:
    return tuple(
        Point(
            point.triangles,
            value(point),
            tooltip=f"{one.name}, {point.triangles:,} triangles: {shown(value(point))}",
        )
        for point in one.points
        if value(point) > 0.0
    )
