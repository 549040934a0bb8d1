"""Every scene replayed with Mitsuba's random numbers, and tested with others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder.climb import FALSE_ALARMS
from mitsuba_ref.records.options import Options
from mitsuba_ref.records.request import FEWEST_SEEDS
from mitsuba_ref.records.results import SceneResult
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.errors import ReportError
from reports.look.heat_map import ramp_colours
from reports.look.pictures import LUMINANCE, signed_difference
from reports.trials import compared_scenes
from reports.trials.compared_scenes import SceneImages, option, verdict_rows
from reports.trials.scene_files import scene_content, scene_names


def session(cases: Sequence[str], bench: Bench) -> AbstractContextManager[Any]:
    """Start Mitsuba and compile for all cases."""
    size = option(bench, "size", ("test", "demo") if bench.quick else ("demo", "test"))
    seeds = bench.options.get("seeds", str(FEWEST_SEEDS))
    if not seeds.isdecimal() or int(seeds) < FEWEST_SEEDS:
        raise ReportError(f"--set seeds={seeds}: expected {FEWEST_SEEDS} or more")
    if source := bench.options.get("from"):
        return compared_scenes.read_instead(cases, bench, Path(source))
    causes = 2 if bench.quick else 8  # pixels that are traced to where their paths part
    options = Options(size=size, seeds=int(seeds), causes=causes)  # type: ignore[arg-type]
    return compared_scenes.compared(cases, bench, options)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the verdict, what each replay and each rung of the ladder says, the maps."""
    scene: SceneResult = bench.session(case, bench.show)
    yield from verdict_rows(case, scene, bench)
    yield Row(case=case, quantity="noise", value="no" if scene.deterministic else "yes")
    for one in scene.replay:
        values = {
            "pixels": one.pixels,
            "divergent pixels": one.divergent,
            "RMSE of the others": one.rmse,
            "traced": one.traced,
            "unexplained": one.unexplained,
        }
        for quantity, value in values.items():
            yield Row(case=case, quantity=quantity, at=float(one.spp), value=value)
    for rung in scene.rungs:
        passed = "holds" if rung.passed else "broken"
        yield Row(case=case, contender=rung.name, quantity="rung", value=passed)
        # other rungs measure shifts in pixels or errors of depth
        if rung.passed and "bias" in rung.detectable and rung.detectable_bias is not None:
            yield Row(
                case=case,
                contender=rung.name,
                quantity="detectable bias",
                value=rung.detectable_bias,
            )
    yield from _pictures(SceneImages(bench, case, scene))


def _pictures(images: SceneImages) -> Iterator[Row]:
    ours, reference = images.load("replay_ours"), images.load("replay_reference")
    if ours is not None and reference is not None and ours.shape == reference.shape:
        yield images.expose(reference)
        yield images.show("replay", ours)
        difference = signed_difference(ours, reference)
        yield from images.differences(replay_difference=difference)
    p, error = images.load("p_map"), images.load("signed_error")
    if p is None or error is None:
        return
    least = FALSE_ALARMS / p[..., 0].size  # one of the pixels reaches it in 1 of 1000 runs
    shown = evidence_against(p.astype(np.float64)) / -math.log(least)
    yield images.row("least p", least)
    yield images.write("p-values", ramp_colours(shown))
    yield from images.differences(mean_difference=error.astype(np.float64) @ LUMINANCE)
    bins = images.array("p_histogram")
    for low, high, count in () if bins is None else bins:
        yield replace(images.row("colour values", float(count)), at=float(low + high) / 2)


def evidence_against(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return -ln of each pixel's p-value, the smallest of its three counted thrice.

    Parameters
    ----------
    p
        (H, W, 3); what is not a number counts as 0.
    """
    least = np.clip(np.nan_to_num(p, nan=0.0).min(axis=2), 1e-300, 1.0)
    return np.maximum(0.0, -np.log(np.minimum(1.0, 3.0 * least)))


def verdict(table: Table) -> str:
    """Return in how many pixels the same random numbers give the same colour."""
    pixels, divergent, unexplained = (
        sum(int(row.value or 0) for row in table.where(quantity=name))
        for name in ("pixels", "divergent pixels", "unexplained")
    )
    if not pixels:
        return ""
    sentence = (
        f"With the same random numbers, {pixels - divergent:,} of {pixels:,} pixels get "
        "the same colour in both programs"
    )
    if not divergent:
        return sentence + "."
    rest = "rounding explains all of the others that were traced"
    return f"{sentence}; {rest if not unexplained else f'{unexplained} are unexplained'}."


STUDY = described(
    "proof",
    cases=scene_names,
    inputs=lambda case, options: scene_content(case),
    any_case=True,
    session=session,
    measure=measure,
    verdict=verdict,
)
