"""Every scene in both renderers: whether the pictures agree up to noise, and how fast."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from mitsuba_ref.records.options import Options
from mitsuba_ref.records.results import Ladder, LadderPoint, SceneResult
from mitsuba_ref.records.verdicts import COMPARED
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.bench.timing import Interval, median_interval
from reports.look.formatting import number
from reports.look.pictures import signed_difference
from reports.trials import compared_scenes
from reports.trials.compared_scenes import SceneImages, option, verdict_rows
from reports.trials.scene_files import scene_content, scene_names

OURS = "lightproof"


def session(cases: Sequence[str], bench: Bench) -> AbstractContextManager[Any]:
    """Start Mitsuba and compile for all cases, or open another record to take them from."""
    size = option(bench, "size", ("test", "demo") if bench.quick else ("demo", "test"))
    ladder = option(bench, "ladder", ("no", "yes") if bench.quick else ("yes", "no"))
    if source := bench.options.get("from"):
        return compared_scenes.read_instead(cases, bench, Path(source))
    # The study `proof` replays; here its kernels would double what is compiled.
    options = Options(size=size, ladder=ladder == "yes", checks="statistics")  # type: ignore
    return compared_scenes.compared(cases, bench, options)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield verdict, error with its floor and tolerance, seconds and the pictures."""
    scene: SceneResult = bench.session(case, bench.show)
    yield from verdict_rows(case, scene, bench)
    yield Row(case=case, quantity="method", value=scene.integrator)
    yield Row(case=case, quantity="samples per pixel", value=float(scene.spp))
    for quantity in ("rmse", "ssim", "flip"):
        if metric := scene.metrics.get(quantity):
            name = quantity.upper()
            yield Row(case=case, quantity=name, value=metric.value)
            if quantity == "rmse":
                yield Row(case=case, quantity="noise floor", value=metric.floor)
                yield Row(case=case, quantity="tolerance", value=metric.tolerance)
    seconds = {OURS: scene.seconds.ours, "Mitsuba": scene.seconds.reference}
    for contender, value in seconds.items():
        yield Row(case=case, quantity="seconds", contender=contender, unit="s", value=value)
    if scene.ladder and (found := times_as_fast(scene.ladder)):
        value, interval = found
        yield Row(
            case=case,
            quantity="times as fast",
            unit="times",
            value=value,
            interval=interval,
        )
    if scene.verdict in COMPARED:
        yield from _pictures(SceneImages(bench, case, scene))


def _pictures(images: SceneImages) -> Iterator[Row]:
    ours, reference = images.load("ours"), images.load("reference")
    if ours is None or reference is None:
        return
    yield images.expose(reference)
    for name, picture in ((OURS, ours), ("Mitsuba", reference)):
        yield images.show(name, picture)
        yield images.show(f"small {name}", picture, "jpg")
    named = {"difference": signed_difference(ours, reference)}
    other = images.load("reference_other_seed")
    if other is not None:
        named["noise_alone"] = signed_difference(other, reference)
    yield from images.differences(**named)


def times_as_fast(ladder: Ladder) -> tuple[float, Interval] | None:
    """Return how many times as long Mitsuba takes to the same error, with an interval.

    The error of independent samples falls with the square root of time, so the time to a
    given error goes as seconds x RMSE^2. The median over pairs of equal sample counts.
    """

    def costs(ours: bool) -> dict[int, float]:
        return {p.spp: _cost(p) for p in ladder.points if (p.renderer == OURS) == ours}

    ours, theirs = costs(True), costs(False)
    ratios = [theirs[spp] / ours[spp] for spp in ours if ours[spp] and theirs.get(spp)]
    return (statistics.median(ratios), median_interval(ratios)) if ratios else None


def _cost(point: LadderPoint) -> float:
    return point.seconds * point.rmse**2


def verdict(table: Table) -> str:
    """Return how many scenes pass, and how fast they are."""
    verdicts = [row.value for row in table.where(quantity="verdict")]
    passed = {row.case for row in table.where(quantity="verdict", value="pass")}
    sentence = f"{verdicts.count('pass')} of {len(verdicts)} scenes agree with Mitsuba"
    found = table.where(quantity="times as fast")
    times = [float(row.value or 1.0) for row in found if row.case in passed]
    if times:
        mean = number(statistics.geometric_mean(times), 2)
        sentence += f"; to the same error {mean} times as fast as Mitsuba scalar_rgb"
        sentence += f" (geometric mean of {len(times)} scenes)"
    return sentence + "."


STUDY = described(
    "scenes",
    cases=scene_names,
    inputs=lambda case, options: scene_content(case),
    any_case=True,
    session=session,
    measure=measure,
    verdict=verdict,
)
