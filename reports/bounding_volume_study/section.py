"""The section "Bounding volumes" of the page: a chart, a table, what they mean."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from reports.charts.columns import volumes_chart
from reports.charts.figure import Point, Series
from reports.page import formatting

_SECTION = Markup("""<section class="scene" aria-labelledby="bounding-volumes">
  <h2 id="bounding-volumes">Bounding volumes</h2>
  <p>{headline}</p>
  <figure>{chart}
    <figcaption>How many random rays meet the volume for each one that meets the object, for
      three objects; 1 is a volume that fits perfectly. Under the names: nanoseconds to test
      16 rays at once.</figcaption></figure>
  <div class="scroll" tabindex="0" role="region" aria-label="Bounding volumes">
  <table>
    <thead><tr><th scope="col">Object</th><th scope="col">Volume</th>
      <th scope="col" class="num">Fit, ms</th>
      <th scope="col" class="num">Test of 16 rays, ns</th>
      <th scope="col" class="num">Area</th><th scope="col" class="num">Tightness</th>
      <th scope="col" class="num">False hits per ray</th></tr></thead>
    <tbody>
{rows}
    </tbody>
  </table>
  </div>
  <p>{rays} random lines without a preferred place or direction for each object; false hits
    are counted per such line. Tightness is the share of rays through the volume that meet
    the object, too. A convex volume is met in proportion to its surface area (Cauchy), so
    the area stands for that share. The test is of 16 rays at once, all inner products
    included, the best of {turns} turns that the volumes took one after the other; the fit
    is the best of three. Every ray that hits an object was seen to hit its volumes before
    anything was timed.</p>
</section>""")
_ROW = Markup(
    '    <tr><th scope="row">{}</th><td>{}</td>' + '<td class="num">{}</td>' * 5 + "</tr>"
)


def bounding_volume_section(study: dict[str, Any]) -> str:
    """Return the HTML of the section; `study` is from `bounding_volume_study`.

    It uses the classes of the page's own style sheet and loads nothing.
    """
    nanoseconds = {one["name"]: one["ns_per_16_rays"] for one in study["volumes"]}
    rows = [
        _row(found, row, nanoseconds[row["volume"]])
        for found in study["objects"]
        for row in found["rows"]
    ]
    section = _SECTION.format(
        headline=_headline(study),
        chart=_chart(study, nanoseconds),
        rows=Markup("\n").join(rows),
        rays=f"{study['rays']:,}",
        turns=study["turns"],
    )
    return str(section)


def _row(found: dict[str, Any], row: dict[str, Any], nanoseconds: float) -> Markup:
    return _ROW.format(
        found["name"],
        row["volume"],
        formatting.number(row["fit_ms"], 2),
        formatting.number(nanoseconds, 2),
        formatting.number(row["area"]),
        f"{row['tightness']:.0%}",
        formatting.number(row["false_hits_per_ray"], 2),
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
