"""results.json: strict JSON, the same after reading, and readable by the report."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

from mitsuba_ref.records.json_files import RecordError, from_json, to_json, write_json
from mitsuba_ref.records.results import (
    AovResult,
    Finite,
    Ladder,
    LadderPoint,
    Metric,
    Results,
    SceneResult,
    Seconds,
)
from mitsuba_ref.records.verdicts import CURRENT, exit_status
from reports.look.results import read_results


def example(**changes: object) -> Results:
    scene = SceneResult(
        name="box",
        title="A box",
        path="scenes/box/scene.xml",
        integrator="path",
        reference_integrator="path",
        width=4,
        height=3,
        spp=16,
        verdict="pass",
        finite=Finite(),
        metrics={"rmse": Metric(0.1, 0.09, 0.11, True, "root mean square")},
        aovs=(AovResult("depth", 1e-7, 1e-4, True, "relative", 10, 2),),
        seconds=Seconds(ours=0.5, reference=2.0, ours_threads=2, reference_threads=2),
        settings={"filter": "box"},
        images={"ours": "images/box/ours.npy"},
        ladder=Ladder(64, "note", (LadderPoint("lightproof", 4, 0.1, 0.2, 0.1),)),
    )
    return Results(
        created="2026-01-01T00:00:00+00:00",
        command="python -m mitsuba_ref",
        machine={"cpu": "a", "cores": 2, "memory_gib": 4.0, "os": "b"},
        versions={"python": "3.11"},
        commit="unknown",
        scenes=(SceneResult(**{**vars(scene), **changes}),),
    )


def test_the_file_has_the_keys_of_schema_1():
    """The names that the report and old files rely on."""
    data = json.loads(to_json(example()))
    assert data["schema"] == 1
    assert set(data) == {
        "schema", "created", "command", "machine", "versions", "commit", "scenes"
    }  # fmt: skip
    assert set(data["scenes"][0]) == {
        "name", "title", "shows", "path", "integrator", "reference_integrator",
        "reference_note", "method", "explain", "width", "height", "spp", "seed",
        "deterministic", "verdict", "reasons", "cautions", "notes", "finite", "metrics",
        "aovs", "seconds", "commands", "settings", "images", "ladder", "replay", "rungs",
    }  # fmt: skip
    assert set(data["scenes"][0]["seconds"]) == {
        "ours", "ours_compile", "reference", "reference_threads", "ours_threads"
    }  # fmt: skip


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, np.float32("nan").item()])
def test_a_value_that_is_not_finite_becomes_null(bad):
    """`NaN` is not JSON: a strict reader would refuse the whole file."""
    text = to_json(example(metrics={"rmse": Metric(bad, None, 0.1, False, "")}))

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    data = json.loads(text, parse_constant=refuse)
    assert data["scenes"][0]["metrics"]["rmse"]["value"] is None


def test_the_report_reads_what_the_harness_writes(tmp_path):
    """The two packages declare their records apart; this is where they must agree."""
    path = tmp_path / "new" / "results.json"
    write_json(example(), path)
    read = read_results(path).scenes[0]
    assert (read.name, read.verdict, read.spp) == ("box", "pass", 16)
    assert read.metrics["rmse"].floor == 0.09
    assert read.aovs[0].compared_pixels == 10
    assert read.ladder is not None
    assert read.ladder.points[0].seconds == 0.1
    assert str(read.images["ours"]).endswith("images/box/ours.npy")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b'"spp": 16', b'"spp": "16"', "Expected `int`, got `str` - at `$.scenes[0].spp`"),
        (b'"pass"', b'"passed"', "Invalid enum value 'passed' - at `$.scenes[0].verdict`"),
        (b'"schema": 1', b'"schema": 2', "Invalid enum value 2 - at `$.schema`"),
        (b'"passed": true', b'"passed": 1', "got `int` - at `$.scenes[0].metrics[...].pas"),
    ],
)
def test_a_record_is_read_strictly(old, new, said):
    """What it was is read back; a wrong type is one line with its place."""
    text = to_json(example())
    assert from_json(text, Results) == example()
    assert old in text
    with pytest.raises(RecordError, match=re.escape(said)):
        from_json(text.replace(old, new, 1), Results)


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "results.json"
    write_json(example(), path)
    before = path.read_bytes()

    def full(source: object, target: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="no space"):
        write_json(example(title="new"), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("verdict", ["pass", "fail", "error"])
def test_files_of_the_first_version_are_still_read(tmp_path, verdict):
    """Their "error" was everything that is a verdict of its own today; no pass, ever."""
    path = tmp_path / "results.json"
    path.write_bytes(to_json(example(verdict=verdict, reasons=("why",))))
    (scene,) = read_results(path).scenes
    assert (scene.verdict, scene.reasons) == (verdict, ("why",))
    assert (exit_status([scene.verdict]) == 0) == (verdict == "pass")


@pytest.mark.parametrize("verdict", CURRENT)
def test_every_verdict_survives_writing_and_reading(tmp_path, verdict):
    path = tmp_path / "results.json"
    write_json(example(verdict=verdict), path)
    assert read_results(path).scenes[0].verdict == verdict
