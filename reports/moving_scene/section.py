"""What the page says of moving scenes: two charts, a table, and when a rebuild pays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from reports.charts.curves import progress_chart
from reports.charts.figure import Point, Series
from reports.look import formatting
from reports.look.template import fill

Record = dict[str, Any]


@dataclass(frozen=True)
class Row:
    """One frame in the table."""

    motion: str
    per_cent: int  # of the motion
    frame: Record
    pays_from: str


def moving_scene_section(study: Record) -> Markup:
    """Return the section's HTML, without a title.

    Parameters
    ----------
    study
        What `study_moving_scene` returned.
    """
    motions = study["motions"]
    text = fill(
        "speed/moving_scene.html",
        filters={"milliseconds": _milliseconds},
        study=study,
        motions=motions,
        times=_chart(motions, "time of a ray, refitted / rebuilt", "ns_per_ray"),
        visits=_chart(motions, "nodes of a ray, refitted / rebuilt", "nodes"),
        rows=[_row(motion["name"], f) for motion in motions for f in _shown(motion)],
    )
    return Markup(text)


def rays_to_win_back(frame: Record) -> float | None:
    """Return how many rays win back a rebuild; None where the refitted tree is as good."""
    saved = frame["refitted"]["ns_per_ray"] - frame["rebuilt"]["ns_per_ray"]
    spent = 1e6 * (frame["rebuild_ms"] - frame["refit_ms"])
    return max(spent, 0.0) / saved if saved > 0.0 else None


def _milliseconds(value: float) -> str:
    return formatting.seconds(value / 1e3)


def _shown(motion: Record) -> Sequence[Record]:
    """Return the frames in the table: after a quarter, half, and all of the way."""
    last = len(motion["frames"]) - 1
    chosen = sorted({max(1, round(part * last)) for part in (0.25, 0.5, 1.0)})
    return [motion["frames"][k] for k in chosen]


def _row(motion: str, frame: Record) -> Row:
    rays = rays_to_win_back(frame)
    # two digits: the times are no better
    pays_from = "never" if rays is None else f"{float(f'{rays:.2g}'):,.0f} rays"
    return Row(motion, round(100.0 * frame["progress"]), frame, pays_from)


def _chart(motions: Sequence[Record], label: str, key: str) -> Markup:
    series = []
    for motion in motions:
        points = []
        for frame in motion["frames"]:
            per_cent = 100.0 * frame["progress"]
            ratio = frame["refitted"][key] / frame["rebuilt"][key]
            tooltip = f"{motion['name']}, {per_cent:.0f} %: {formatting.number(ratio)}"
            points.append(Point(per_cent, ratio, tooltip=tooltip))
        series.append(Series(motion["name"], tuple(points)))
    ends = ", ".join(f"{one.name} {formatting.number(one.points[-1].y)}" for one in series)
    return progress_chart(
        series, y_label=label, description=f"{label}; at the end: {ends}."
    )
