"""The page of one scene: both pictures, what was judged, what replay and tests prove."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from mitsuba_ref.records.results import (
    DivergentPixel,
    Ladder,
    LadderPoint,
    Metric,
    Results,
    SceneResult,
)
from reports.bench.rows import Row, Table
from reports.bench.store import Store
from reports.bench.study import Study
from reports.charts.columns import Bin, histogram_chart
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.look import formatting
from reports.look.results import read_results
from reports.look.template import fill

OURS = "lightproof"


@dataclass(frozen=True)
class Part:
    """What one study, `scenes` or `proof`, has of a scene."""

    record: Results
    rows: Table

    @property
    def scene(self) -> SceneResult:
        """The harness's result."""
        return self.record.scenes[0]

    def picture(self, name: str) -> str | None:
        """Return the path of a picture."""
        path: str | None = self.rows.value(quantity="picture", contender=name)
        return path

    def number(self, quantity: str, contender: str = "") -> float | None:
        """Return a value."""
        value: float | None = self.rows.value(quantity=quantity, contender=contender)
        return value

    @property
    def judged(self) -> dict[str, Metric]:
        """The metrics that were judged, RMSE first."""
        found = self.scene.metrics
        keys = sorted(found, key=lambda key: key != "rmse")
        return {key: found[key] for key in keys if found[key].passed is not None}

    @property
    def shown(self) -> dict[str, Metric]:
        """The metrics that are only shown."""
        metrics = self.scene.metrics.items()
        return {key: metric for key, metric in metrics if metric.passed is None}

    @property
    def marks(self) -> list[tuple[int, DivergentPixel]]:
        """The listed divergent pixels, with the samples of their replay."""
        return [(one.spp, pixel) for one in self.scene.replay for pixel in one.listed]


def page_of(case: str) -> str:
    """Return the file name of a scene's page."""
    return f"scene_{formatting.slug(case)}.html"


def scene_pages(name: str, study: Study, table: Table, folder: Path) -> dict[str, str]:
    """Return the page of each scene in a table of the study `scenes` or `proof`.

    Raises
    ------
    ReportError
        If a record of the harness cannot be read.
    """
    store = Store(folder / "data")
    tables = {one: store.read(one) for one in ("scenes", "proof")}
    pages = {}
    for case in table.distinct("case"):
        parts = {}
        for one, rows in tables.items():
            record = rows.value(case=case, quantity="record")
            if record and (folder / record).exists():
                parts[one] = Part(read_results(folder / record), rows.where(case=case))
        if parts:
            pages[page_of(case)] = scene_page(case, parts)
    return pages


def scene_page(case: str, parts: dict[str, Part]) -> str:
    """Return the page of a scene as HTML.

    Parameters
    ----------
    case
        Of the studies.
    parts
        "scenes" and "proof", at least one of them.
    """
    whole, proof = parts.get("scenes"), parts.get("proof")
    ladder = whole.scene.ladder if whole else None
    return fill(
        "scene.html",
        case=case,
        whole=whole,
        proof=proof,
        scene=(whole or parts["proof"]).scene,
        chart=ladder_chart(ladder) if ladder else None,
        histogram=_histogram(proof.rows) if proof else None,
    )


def ladder_chart(ladder: Ladder) -> Markup | None:
    """Draw seconds against RMSE; None where no point has both above zero."""
    names = sorted({p.renderer for p in ladder.points}, key=lambda name: name != OURS)
    series = [
        Series(name, points)
        for name in names
        if (points := tuple(map(_point, _drawn(ladder, name))))
    ]
    if not series:
        return None
    return log_log_chart(
        series,
        x_label="seconds",
        y_label="RMSE",
        description="Seconds against RMSE on logarithmic axes; lower left is better.",
    )


def _drawn(ladder: Ladder, name: str) -> list[LadderPoint]:
    points = [p for p in ladder.points if p.renderer == name]
    return sorted(
        (p for p in points if p.seconds > 0.0 and p.rmse > 0.0), key=lambda p: p.spp
    )


def _point(point: LadderPoint) -> Point:
    return Point(
        point.seconds,
        point.rmse,
        label=str(point.spp),
        tooltip=f"{point.renderer}, {point.spp} samples per pixel: "
        f"{formatting.seconds(point.seconds)}, RMSE {formatting.number(point.rmse)}",
    )


def _histogram(rows: Table) -> Markup | None:
    """Draw p-values: without a difference each bin of equal width holds the same share."""
    found: list[Row] = rows.curve(quantity="colour values")
    total = sum(float(row.value or 0.0) for row in found)
    if not total:
        return None
    ends = [index / len(found) for index in range(len(found) + 1)]
    bins = [
        Bin(low, high, float(row.value or 0.0), total / len(found))
        for (low, high), row in zip(itertools.pairwise(ends), found, strict=True)
    ]
    return histogram_chart(
        bins,
        x_ticks=(0.0, 0.25, 0.5, 0.75, 1.0),
        x_label="p-value of each colour value",
        description=f"Histogram of p-values: {bins[0].count:.0f} in the first of "
        f"{len(bins)} bins, expected {bins[0].expected:.0f}.",
    )
