"""What the page needs about one scene beyond its record: pictures, chart, one-liners."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from mitsuba_ref.records.results import Ladder, LadderPoint, Metric, SceneResult
from mitsuba_ref.records.verdicts import COMPARED
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.errors import ReportError
from reports.look import formatting, pictures
from reports.look.anchors import scene_anchors

OURS = "lightproof"


@dataclass(frozen=True)
class Pictures:
    """The pictures of one scene as data URIs, and how they were made visible."""

    width: int
    height: int
    stops: int  # exposure, the same on both sides
    scale: float  # the differences run from -scale to scale
    ours: str
    reference: str
    difference: str
    self_difference: str | None  # Mitsuba seed A minus seed B: what noise alone looks like


@dataclass(frozen=True)
class SceneSection:
    """One scene, ready to be drawn."""

    result: SceneResult
    anchor: str
    pictures: Pictures | None
    chart: Markup | None
    chart_note: str

    @property
    def method(self) -> str:
        """How it was rendered, beyond the integrator's name, which stands beside it."""
        return self.result.method.removeprefix(self.result.integrator).lstrip(" ,;:")

    @property
    def judged(self) -> dict[str, Metric]:
        """The metrics that were judged, RMSE first."""
        found = self.result.metrics
        keys = sorted(found, key=lambda key: key != "rmse")
        return {key: found[key] for key in keys if found[key].passed is not None}

    @property
    def not_judged(self) -> dict[str, Metric]:
        """The metrics that are only shown."""
        found = self.result.metrics
        return {key: metric for key, metric in found.items() if metric.passed is None}

    @property
    def rmse_share(self) -> float | None:
        """RMSE as a share of its tolerance, 1 is the limit."""
        return self._share("value")

    @property
    def floor_share(self) -> float | None:
        """The noise floor of RMSE as a share of the tolerance."""
        return self._share("floor")

    def _share(self, field: str) -> float | None:
        rmse = self.result.metrics.get("rmse")
        if rmse is None or not rmse.tolerance:
            return None
        value = getattr(rmse, field)
        return None if value is None else float(value) / rmse.tolerance


def build_sections(scenes: Sequence[SceneResult], folder: Path) -> list[SceneSection]:
    """Load and convert what every scene shows; pictures are named relative to `folder`.

    Raises
    ------
    ReportError
        If a scene that was compared lacks a picture.
    """
    sections = []
    for scene, anchor in zip(scenes, scene_anchors(scenes), strict=True):
        chart = ladder_chart(scene.ladder) if scene.ladder else None
        note = equal_error_note(scene.ladder) if scene.ladder else ""
        sections.append(SceneSection(scene, anchor, _pictures(scene, folder), chart, note))
    return sections


def _pictures(scene: SceneResult, folder: Path) -> Pictures | None:
    """Return the pictures; a scene that was not compared may have none, or two sizes."""
    if scene.verdict == "size-mismatch":
        return None
    for side in ("ours", "reference"):
        if side not in scene.images:
            if scene.verdict not in COMPARED:
                return None
            raise ReportError(f"scene {scene.name}: no {side} picture, but it was compared")
    reference = pictures.load_picture(folder / scene.images["reference"])
    ours = pictures.load_picture(folder / scene.images["ours"])
    differences = [_difference(scene, "ours", ours, reference)]
    if "reference_other_seed" in scene.images:
        other = pictures.load_picture(folder / scene.images["reference_other_seed"])
        differences.append(_difference(scene, "reference_other_seed", other, reference))
    scale = pictures.symmetric_scale(*differences)
    stops = pictures.exposure_stops(reference)
    uris = [pictures.difference_uri(one, scale) for one in differences]
    return Pictures(
        width=ours.shape[1],
        height=ours.shape[0],
        stops=stops,
        scale=scale,
        ours=pictures.picture_uri(pictures.tone_mapped(ours, stops)),
        reference=pictures.picture_uri(pictures.tone_mapped(reference, stops)),
        difference=uris[0],
        self_difference=uris[1] if len(uris) > 1 else None,
    )


def _difference(
    scene: SceneResult, side: str, picture: pictures.Picture, reference: pictures.Picture
) -> pictures.Difference:
    try:
        return pictures.signed_difference(picture, reference)
    except ReportError as error:
        raise ReportError(f"scene {scene.name}: {side} and reference: {error}") from None


def ladder_chart(ladder: Ladder) -> Markup | None:
    """Draw seconds against RMSE; None where no point has both above zero."""
    series = []
    for renderer, points in _by_renderer(ladder).items():
        marks = tuple(
            Point(
                x=point.seconds,
                y=point.rmse,
                label=f"{point.spp} spp" if index == 0 else str(point.spp),
                tooltip=(
                    f"{renderer}, {point.spp} samples per pixel: "
                    f"{formatting.seconds(point.seconds)}, "
                    f"RMSE {formatting.number(point.rmse)}"
                ),
            )
            for index, point in enumerate(points)
            if point.seconds > 0.0 and point.rmse > 0.0
        )
        if marks:
            series.append(Series(renderer, marks))
    if not series:
        return None
    return log_log_chart(
        series,
        x_label="seconds",
        y_label="RMSE",
        description="Seconds against RMSE on logarithmic axes; lower left is better. "
        + equal_error_note(ladder),
    )


def equal_error_note(ladder: Ladder) -> str:
    """Say how the times compare at equal error, from the pairs of equal sample counts.

    The error of independent samples falls with the square root of time, so the time to a
    given error goes as seconds x RMSE^2, at every rung alike.
    """
    curves = _by_renderer(ladder)
    ours = {point.spp: point for point in curves.get(OURS, [])}
    notes = []
    for renderer, points in curves.items():
        if renderer == OURS:
            continue
        ratios = [
            _cost(point) / _cost(ours[point.spp])
            for point in points
            if point.spp in ours and _cost(point) > 0.0 and _cost(ours[point.spp]) > 0.0
        ]
        if ratios:
            middle, low, high = (
                formatting.number(value, 2)
                for value in (statistics.median(ratios), min(ratios), max(ratios))
            )
            spread = f" (median of {len(ratios)} sample counts, {low} to {high})"
            notes.append(
                f"To the same RMSE {renderer} takes {middle} times as long as {OURS}"
                f"{spread if len(ratios) > 1 else ''}."
            )
    return " ".join(notes)


def _cost(point: LadderPoint) -> float:
    return point.seconds * point.rmse**2


def _by_renderer(ladder: Ladder) -> dict[str, list[LadderPoint]]:
    """Group the points, ours first, each by rising sample count."""
    names = list(dict.fromkeys(point.renderer for point in ladder.points))
    names.sort(key=lambda name: name != OURS)
    return {
        name: sorted((p for p in ladder.points if p.renderer == name), key=lambda p: p.spp)
        for name in names
    }
