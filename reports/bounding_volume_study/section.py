"""The section "Bounding volumes" of the page: a chart, a table, what they mean."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from reports.charts.columns import volumes_chart
from reports.charts.figure import Point, Series
from reports.look import formatting
from reports.look.template import fill


def bounding_volume_section(study: dict[str, Any]) -> str:
    """Return the HTML of the section; `study` is from `bounding_volume_study`."""
    nanoseconds = {one["name"]: one["ns_per_16_rays"] for one in study["volumes"]}
    return fill(
        "speed/bounding_volumes.html",
        study=study,
        nanoseconds=nanoseconds,
        headline=_headline(study),
        chart=_chart(study, nanoseconds),
    )


def _headline(study: dict[str, Any]) -> str:
    """Say for each object which volume lets through the fewest rays."""
    parts = []
    for found in study["objects"]:
        best = min(found["rows"], key=lambda row: row["let_through"])
        box = next(row for row in found["rows"] if row["volume"] == "AABB")
        parts.append(
            f"{found['name']}: {best['volume']} ({best['tightness']:.0%}, "
            f"AABB {box['tightness']:.0%})"
        )
    return (
        "The tightest volume, and the share of its rays that hit: " + "; ".join(parts) + "."
    )


def _chart(study: dict[str, Any], nanoseconds: dict[str, float]) -> Markup:
    columns = [(k, f"{formatting.number(ns, 2)} ns") for k, ns in nanoseconds.items()]
    place = {name: index for index, name in enumerate(nanoseconds)}
    series = [
        Series(
            found["name"],
            tuple(
                Point(
                    place[row["volume"]],
                    row["let_through"],
                    tooltip=f"{row['volume']} around the object {found['name']}: "
                    f"{formatting.number(row['let_through'])} rays per ray that hits",
                )
                for row in found["rows"]
            ),
        )
        for found in study["objects"]
    ]
    return volumes_chart(
        columns,
        series,
        y_label="rays let through per hit",
        description="Rays that meet each bounding volume for one that meets the object, "
        "on a logarithmic axis; lower is better. " + _headline(study),
    )
