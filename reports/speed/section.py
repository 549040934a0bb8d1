"""From the times of a benchmark to its table: medians, ranges, ratios of pairs, targets."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

from markupsafe import Markup

from reports.charts.figure import Point, Series
from reports.charts.rows import timings_chart
from reports.look import formatting
from reports.speed.record import Benchmark, Renderer

REFERENCE = "mitsuba scalar_rgb"  # the peer that the target speaks of


@dataclass(frozen=True)
class Spread:
    """Median and range of repeats."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: tuple[float, ...]) -> Spread | None:
        """Return the spread, or None without values."""
        return cls(statistics.median(values), min(values), max(values)) if values else None


@dataclass(frozen=True)
class Row:
    """One renderer in the table."""

    name: str
    seconds: Spread | None
    ratio: Spread | None  # its seconds over ours, pair by pair within a round
    million_paths_per_second: float | None
    million_rays_per_second: float | None
    unavailable: str


@dataclass(frozen=True)
class Target:
    """What was to be reached, and whether it was."""

    what: str
    wanted: str
    measured: str
    met: bool | None  # None: not measured


@dataclass(frozen=True)
class BenchmarkSection:
    """One benchmark, ready to be drawn."""

    record: Benchmark
    rows: tuple[Row, ...]
    warm: Spread | None
    cold: Spread | None
    targets: tuple[Target, ...]
    chart: Markup
    headline: str


def build_benchmark_section(record: Benchmark) -> BenchmarkSection:
    """Work out what the page shows from the raw times."""
    rows = tuple(_row(one, record) for one in record.renderers)
    warm, cold = Spread.of(record.starts.warm), Spread.of(record.starts.cold)
    return BenchmarkSection(
        record=record,
        rows=rows,
        warm=warm,
        cold=cold,
        targets=_targets(record, rows, warm, cold),
        chart=_chart(record),
        headline=_headline(rows),
    )


def _row(one: Renderer, record: Benchmark) -> Row:
    ours = record.renderers[0]
    spread = Spread.of(one.seconds)
    rounds = zip(one.seconds, ours.seconds, strict=False)
    pairs = tuple(theirs / mine for theirs, mine in rounds)
    million_paths = record.width * record.height * record.spp / 1e6
    paths = million_paths / spread.median if spread else None
    rays = paths * record.rays_per_path if paths and record.rays_per_path else None
    return Row(
        name=one.name,
        seconds=spread,
        ratio=Spread.of(pairs) if one is not ours else None,
        million_paths_per_second=paths,
        million_rays_per_second=rays,
        unavailable=one.unavailable,
    )


def _headline(rows: tuple[Row, ...]) -> str:
    """Say in one sentence how fast ours is beside every peer."""
    parts = [
        f"{formatting.number(row.ratio.median, 2)} times as fast as {row.name}"
        for row in rows
        if row.ratio
    ]
    return f"{rows[0].name} is " + " and ".join(parts) if parts else ""


def _targets(
    record: Benchmark, rows: tuple[Row, ...], warm: Spread | None, cold: Spread | None
) -> tuple[Target, ...]:
    targets = []
    if "speed_ratio" in record.targets:
        wanted = record.targets["speed_ratio"]
        ratio = next((row.ratio for row in rows if row.name == REFERENCE), None)
        targets.append(
            Target(
                f"speed beside {REFERENCE}, equal workers",
                f"at least {formatting.number(wanted)} times",
                f"{formatting.number(ratio.median)} times" if ratio else "not measured",
                ratio.median >= wanted if ratio else None,
            )
        )
    starts = (
        ("warm_seconds", "warm start at 1 sample per pixel", warm),
        ("cold_seconds", "cold start, nothing cached", cold),
    )
    for key, what, spread in starts:
        if key in record.targets:
            wanted = record.targets[key]
            targets.append(
                Target(
                    what,
                    f"under {formatting.seconds(wanted)}",
                    formatting.seconds(spread.median) if spread else "not measured",
                    spread.median < wanted if spread else None,
                )
            )
    return tuple(targets)


def _chart(record: Benchmark) -> Markup:
    series = []
    for one in record.renderers:
        points = tuple(
            Point(
                time, 0.0, tooltip=f"{one.name}, round {turn}: {formatting.seconds(time)}"
            )
            for turn, time in enumerate(one.seconds, start=1)
        )
        if points:
            series.append(Series(one.name, points))
    description = "Seconds of every repeat, one row a renderer."
    return timings_chart(series, x_label="seconds", description=description)
