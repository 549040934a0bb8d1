"""The page of speed against accuracy, speed_accuracy.html."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from renderer.process.names import SAMPLERS
from reports.charts.curves import log_log_chart
from reports.charts.figure import SYMBOLS, Point, Series
from reports.look.formatting import number, seconds
from reports.look.template import fill
from reports.speed_accuracy.record import (
    OURS,
    Curve,
    NoiselessPicture,
    NoiselessScene,
    NoisyScene,
    SpeedAccuracy,
)
from reports.speed_accuracy.summary import (
    Interval,
    efficiencies,
    mean_interval,
    pareto_front,
    scene_ratio,
)

HEIGHT = 520  # [px], with room for the legend of a dozen curves
SMALLEST = 1e-9  # of errors on a logarithmic axis: an exact picture has a place too
# open marks, with and without a dot; a dot in a full one is another method of ours
FILLINGS_OF_PEERS = {"mitsuba scalar_rgb": 1, "mitsuba llvm_ad_rgb": 3}


@dataclass(frozen=True)
class NoisySection:
    """A scene with noise, ready to be drawn."""

    scene: NoisyScene
    chart: Markup
    rows: list[tuple[Curve, Interval, tuple[float, Interval] | None, bool]]
    ratio: tuple[float, Interval] | None  # our best beside the best peer


@dataclass(frozen=True)
class NoiselessSection:
    """A scene without noise, ready to be drawn."""

    scene: NoiselessScene
    chart: Markup
    rows: list[tuple[NoiselessPicture, bool]]
    ours: NoiselessPicture  # the nearest to the truth, and among these the fastest
    peer: NoiselessPicture | None


def speed_accuracy_page(record: SpeedAccuracy) -> str:
    """Return the whole page as HTML."""
    every: tuple[NoisyScene | NoiselessScene, ...] = (*record.noisy, *record.noiseless)
    reasons = {(who, why) for scene in every for who, why in scene.unavailable.items()}
    return fill(
        "speed/speed_accuracy.html",
        filters={"interval": interval_text, "name": name_of},
        record=record,
        efficiencies=efficiencies(record),
        noisy=[noisy_section(scene) for scene in record.noisy],
        noiseless=[noiseless_section(scene) for scene in record.noiseless],
        unavailable=[
            (who, why, [one.scene for one in every if one.unavailable.get(who) == why])
            for who, why in sorted(reasons)
        ],
        scenes=len(every),
    )


def interval_text(interval: Interval) -> str:
    """Return both ends of an interval."""
    return " to ".join(number(end) for end in interval)


def name_of(one: Curve | NoiselessPicture) -> str:
    """Return the words that tell a contender from the others of its scene."""
    words = [one.renderer, one.method]
    if isinstance(one, Curve):
        words.append(one.sampler)
    else:
        words.append(one.ray_offset and f"offset {one.ray_offset}")
        words.append("replay" if one.numbers == "replayed" else "")
    return ", ".join(word for word in words if word)


def noisy_section(scene: NoisyScene) -> NoisySection:
    """Work out curves, front and ratios of a scene."""
    places = [(one, step) for one in scene.curves for step in one.pictures]
    front = pareto_front([(step.time, step.error) for _, step in places])
    on_front = {id(places[index][1]) for index in front}
    chart = log_log_chart(
        [
            Series(name_of(one), _points(one), look)
            for one, look in zip(scene.curves, _looks(scene.curves), strict=True)
        ],
        x_label="seconds",
        y_label="relMSE",
        guide_slope=-1.0,
        front=[(places[i][1].time, places[i][1].error) for i in front],
        height=HEIGHT,
        description=f"Seconds against relMSE of all contenders on {scene.scene}; the "
        "Pareto front is made of "
        + ", ".join(f"{name_of(places[i][0])} {places[i][1].spp}" for i in front),
    )
    rows = [
        (
            one,
            mean_interval(one.last.errors),
            scene_ratio(scene, one),
            any(id(step) in on_front for step in one.pictures),
        )
        for one in sorted(scene.curves, key=lambda one: -one.last.worth)
    ]
    return NoisySection(scene, chart, rows, scene_ratio(scene, scene.best_of_ours))


def _points(curve: Curve) -> tuple[Point, ...]:
    points = []
    for step in curve.pictures:
        low, high = mean_interval(step.errors)
        points.append(
            Point(
                step.time,
                max(step.error, SMALLEST),
                tooltip=f"{name_of(curve)}: {step.spp} samples, {seconds(step.time)}, "
                f"relMSE {number(step.error)} ({interval_text((low, high))})",
                x_range=(min(step.seconds), max(step.seconds)),
                y_range=(max(low, SMALLEST), max(high, SMALLEST)),
            )
        )
    return tuple(points)


def _looks(curves: Sequence[Curve]) -> list[int]:
    """Return a look for each curve: one colour a sampler, one filling a renderer."""
    method = next(one.method for one in curves if one.renderer == OURS)
    fillings = {OURS: 0, **FILLINGS_OF_PEERS}
    colours = {name: index for index, name in enumerate(SAMPLERS)}
    looks, others = [], 2 * len(SYMBOLS)
    for one in curves:
        if one.renderer == OURS and one.method != method:
            looks.append(others)
            others += 1
        else:
            filling = fillings.get(one.renderer, 3) * len(SYMBOLS)
            looks.append(filling + colours.get(one.sampler, 0))
    return looks


def noiseless_section(scene: NoiselessScene) -> NoiselessSection:
    """Work out what is drawn of a scene without noise."""
    pictures = sorted(scene.pictures, key=lambda one: one.time)
    front = pareto_front([(one.time, one.error) for one in pictures])
    families: dict[str, list[NoiselessPicture]] = {}
    for one in pictures:
        families.setdefault(name_of(one), []).append(one)
    labelled: dict[float, NoiselessPicture] = {}  # what is fastest at an error
    for one in reversed(pictures):
        labelled[one.error] = one
    chart = log_log_chart(
        [
            Series(
                name,
                tuple(_place(one, labelled[one.error] is one) for one in family),
                connected=False,
            )
            for name, family in families.items()
        ],
        x_label="seconds",
        y_label="error beside the truth",
        guide_slope=None,
        front=[(pictures[i].time, max(pictures[i].error, SMALLEST)) for i in front],
        description=f"Seconds against the distance to the truth on {scene.scene}, a point "
        "for each structure; a label names the fastest at its error.",
    )
    ours = [one for one in pictures if one.renderer == OURS]
    peers = [one for one in pictures if one.renderer != OURS]
    return NoiselessSection(
        scene,
        chart,
        [(one, index in front) for index, one in enumerate(pictures)],
        min(ours, key=lambda one: (one.error, one.time)),
        min(peers, key=lambda one: one.time, default=None),
    )


def _place(one: NoiselessPicture, labelled: bool) -> Point:
    return Point(
        one.time,
        max(one.error, SMALLEST),
        one.structure if labelled else "",
        f"{name_of(one)} {one.structure}: {seconds(one.time)}, error {number(one.error)}, "
        f"{one.pixels_off} pixels off",
        (min(one.seconds), max(one.seconds)),
    )
