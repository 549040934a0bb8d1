"""Reads results.json into the records of `mitsuba_ref.records`, trusting nothing in it.

The file may be old, edited or cut short, so every field is checked and a mistake is one
line that names its place. The harness alone decides what passes; the reader adds one
rule: a verdict of "pass" that the file's own numbers contradict is shown as a failure.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from mitsuba_ref.records.results import (
    SCHEMA,
    AovResult,
    Finite,
    Ladder,
    LadderPoint,
    Metric,
    Results,
    SceneResult,
    Seconds,
)
from mitsuba_ref.records.verdicts import VERDICTS
from reports.errors import ReportError
from reports.json_fields import JsonFields, load_json
from reports.rungs_reader import read_replay, read_rung


def read_results(path: Path) -> Results:
    """Read and check results.json.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    top = load_json(path)
    schema = top.integer("schema")
    if schema != SCHEMA:
        raise ReportError(f"{path}: schema {schema}; this version reads schema {SCHEMA}")
    scenes = tuple(_scene(entry) for entry in top.objects("scenes"))
    if not scenes:
        raise ReportError(f"{path}: holds no scene")
    names = [scene.name for scene in scenes]
    for name in names:
        if names.count(name) > 1:
            raise ReportError(f"{path}: scene {name} is there twice")
    return Results(
        created=top.text("created", ""),
        command=top.text("command", ""),
        machine=top.strings("machine"),
        versions=top.strings("versions"),
        commit=top.text("commit", "unknown"),
        scenes=tuple(map(contradicted, scenes)),
    )


def worst_first(results: Results) -> list[SceneResult]:
    """Return the scenes, the most severe verdict first, else in the file's order."""
    order = list(VERDICTS)
    return sorted(results.scenes, key=lambda scene: order.index(scene.verdict))


def contradicted(scene: SceneResult) -> SceneResult:
    """Return the scene, as a failure if its own numbers contradict its pass."""
    if scene.verdict != "pass":
        return scene
    judged: list[tuple[str, bool | None]] = [
        *((name, metric.passed) for name, metric in scene.metrics.items()),
        *((aov.name, aov.passed) for aov in scene.aovs),
        *((f"the replay at {one.spp} samples", one.passed) for one in scene.replay),
        *((f"rung {rung.name}", rung.passed) for rung in scene.rungs),
    ]
    found = [f"the file says pass, but {name} failed" for name, ok in judged if ok is False]
    if not any(ok for _, ok in judged):
        found.append("the file says pass, but no comparison in it passed")
    if not scene.finite.passed:
        found.append("the file says pass, but not every value is finite")
    if not found:
        return scene
    return replace(scene, verdict="fail", reasons=(*scene.reasons, *found))


def _scene(entry: JsonFields) -> SceneResult:
    verdict = entry.text("verdict")
    if verdict not in VERDICTS:
        known = ", ".join(VERDICTS)
        raise ReportError(f"{entry.where}.verdict: {verdict!r}; known: {known}")
    counts, seconds = entry.object("finite"), entry.object("seconds")
    has_ladder = entry.data.get("ladder") is not None
    name = entry.text("name")
    return SceneResult(
        name=name,
        title=entry.text("title", "") or name,
        shows=entry.text("shows", ""),
        path=entry.text("path", ""),
        integrator=entry.text("integrator", ""),
        reference_integrator=entry.text("reference_integrator", ""),
        reference_note=entry.text("reference_note", ""),
        method=entry.text("method", ""),
        explain=entry.text("explain", ""),
        width=entry.integer("width", 0),
        height=entry.integer("height", 0),
        spp=entry.integer("spp", 0),
        seed=entry.integer("seed", 0),
        deterministic=bool(entry.flag("deterministic")),
        verdict=verdict,
        reasons=entry.texts("reasons"),
        finite=Finite(*(counts.integer(side.name, 0) for side in fields(Finite))),
        metrics={key: _metric(metric) for key, metric in entry.named_objects("metrics")},
        aovs=tuple(_aov(aov) for aov in entry.objects("aovs")),
        seconds=_seconds(seconds),
        commands=entry.strings("commands"),
        settings=entry.strings("settings"),
        images=entry.strings("images"),
        ladder=_ladder(entry.object("ladder")) if has_ladder else None,
        replay=tuple(read_replay(one) for one in entry.objects("replay")),
        rungs=tuple(read_rung(one) for one in entry.objects("rungs")),
    )


def _metric(entry: JsonFields) -> Metric:
    return Metric(
        value=entry.number("value"),
        floor=entry.number("floor"),
        tolerance=entry.number("tolerance"),
        passed=entry.flag("passed"),
        meaning=entry.text("meaning", ""),
    )


def _aov(entry: JsonFields) -> AovResult:
    passed = entry.flag("passed")
    if passed is None:
        raise ReportError(f"{entry.where}.passed: expected true or false, found nothing")
    return AovResult(
        name=entry.text("name"),
        value=entry.number("value"),
        tolerance=_needed(entry, "tolerance"),
        passed=passed,
        meaning=entry.text("meaning", ""),
        compared_pixels=entry.integer("compared_pixels", 0),
        edge_pixels=entry.integer("edge_pixels", 0),
    )


def _seconds(entry: JsonFields) -> Seconds:
    def threads(key: str) -> int | None:
        return entry.integer(key) if entry.data.get(key) is not None else None

    return Seconds(
        ours=entry.number("ours"),
        ours_compile=entry.number("ours_compile"),
        reference=entry.number("reference"),
        reference_threads=threads("reference_threads"),
        ours_threads=threads("ours_threads"),
    )


def _ladder(entry: JsonFields) -> Ladder:
    points: list[dict[str, Any]] = []
    for point in entry.objects("points"):
        measured = {key: _needed(point, key) for key in ("seconds", "rmse", "trimmed_rmse")}
        points.append(
            {"renderer": point.text("renderer"), "spp": point.integer("spp"), **measured}
        )
    return Ladder(
        reference_spp=entry.integer("reference_spp", 0),
        note=entry.text("note", ""),
        points=tuple(LadderPoint(**point) for point in points),
    )


def _needed(entry: JsonFields, key: str) -> float:
    value = entry.number(key)
    if value is None:
        raise ReportError(f"{entry.where}.{key}: expected a number, found nothing")
    return value
