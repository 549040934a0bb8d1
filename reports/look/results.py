"""Reads results.json into the harness's own records, trusting nothing in it.

The harness alone decides what passes; the reader adds one rule: a verdict of "pass" that
the file's own numbers contradict is shown as a failure.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mitsuba_ref.records.json_files import RecordError, from_json
from mitsuba_ref.records.results import ReplayResult, Results, SceneResult
from reports.errors import ReportError


def read_results(path: Path) -> Results:
    """Read and check results.json.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    try:
        results = from_json(path.read_bytes(), Results)
    except OSError as error:
        raise ReportError(f"{path}: cannot be read: {error.strerror}") from None
    except RecordError as error:
        raise ReportError(f"{path}: {error}") from None
    if not results.scenes:
        raise ReportError(f"{path}: holds no scene")
    names = [scene.name for scene in results.scenes]
    for index, scene in enumerate(results.scenes):
        if scene.name in names[:index]:
            raise ReportError(f"{path}: scene {scene.name} is there twice")
        _check(scene, f"{path}: scenes[{index}]")
    return replace(results, scenes=tuple(map(contradicted, results.scenes)))


def contradicted(scene: SceneResult) -> SceneResult:
    """Return the scene with title, as a failure if its own numbers contradict its pass."""
    replays = tuple(map(_replay_contradicted, scene.replay))
    scene = replace(scene, title=scene.title or scene.name, replay=replays)
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


def _replay_contradicted(one: ReplayResult) -> ReplayResult:
    within = one.rmse is not None and one.rmse <= one.rmse_limit
    within = within and one.divergent <= one.divergent_allowed
    passed = one.passed and (within or one.explained)
    verdict = "fail" if one.verdict == "pass" and not passed else one.verdict
    return replace(one, passed=passed, verdict=verdict)


def _check(scene: SceneResult, place: str) -> None:
    """Refuse numbers that their type allows and their meaning does not."""
    for index, one in enumerate(scene.replay):
        where = f"{place}.replay[{index}]"
        for name in ("spp", "seed", "pixels", "divergent", "divergent_allowed"):
            if getattr(one, name) < 0:
                found = getattr(one, name)
                raise ReportError(f"{where}.{name}: expected 0 or more, found {found}")
        if one.divergent > one.pixels:
            raise ReportError(f"{where}.divergent: {one.divergent} of {one.pixels} pixels")
    for index, rung in enumerate(scene.rungs):
        for name in ("p_value", "false_alarm_rate"):
            share = getattr(rung, name)
            if share is not None and not 0.0 <= share <= 1.0:
                raise ReportError(
                    f"{place}.rungs[{index}].{name}: expected 0 to 1, found {share}"
                )
