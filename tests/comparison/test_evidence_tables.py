"""The terminal shows every replay and every rung, and fits seventeen scenes."""

from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.records.results import (
    DivergentPixel,
    Metric,
    ReplayResult,
    Rung,
    SceneResult,
)

REPLAY = ReplayResult(
    spp=16,
    pixels=2400,
    divergent=3,
    divergent_allowed=2,
    rmse=3.2e-7,
    rmse_limit=1e-5,
    passed=False,
    sentence="",
    listed=(DivergentPixel(7, 9, (1.0,), (2.0,), 0.5, cause="bounce 2: another side"),),
)
RUNG = Rung(
    "tiles", True, 2.125, 6.75, 0.98, 1e-3, 0.0171, "relative bias of a tile", "Fine."
)
SHIFT = replace(
    RUNG, name="registration", detectable_bias=0.07, detectable="shift in pixels"
)
NOT_ASKED = Rung(
    "convergence", True, None, None, None, None, None, "", "Not asked: no noise."
)
SCENE = SceneResult(name="box", verdict="fail", replay=(REPLAY,), rungs=(SHIFT, RUNG))


def shown(*scenes: SceneResult, width: int = 120) -> str:
    text = io.StringIO()
    print_table(scenes, Console(file=text, width=width))
    return text.getvalue()


def cells(output: str, word: str) -> list[str]:
    return next(line for line in output.splitlines() if word in line).split()


def test_a_replay_is_one_line_with_its_numbers_and_limits():
    output = shown(SCENE)
    assert cells(output, "3.2e-07") == [
        "box", "16", "3", "2", "2400", "3.2e-07", "1e-05", "broken"
    ]  # fmt: skip
    assert "box: 16 spp, pixel 7,9: bounce 2: another side" in output


def test_a_replay_that_could_not_be_compared_says_its_verdict():
    nothing = ReplayResult(spp=1, passed=False, verdict="not-finite", sentence="")
    output = shown(replace(SCENE, replay=(nothing,), rungs=()))
    assert cells(output, "not-finite") == ["box", "1", "not-finite"]


def test_a_scene_that_cannot_be_replayed_says_why():
    output = shown(replace(SCENE, replay=(), settings={"replay": "sampler [halton]"}))
    assert "box: not replayed: sampler [halton]" in output
    assert "same random numbers" not in output


def test_a_rung_is_one_line_with_what_it_would_have_seen():
    output = shown(replace(SCENE, rungs=(SHIFT, replace(RUNG, passed=False), NOT_ASKED)))
    assert cells(output, "registration")[-3:] == ["0.07", "px", "holds"]
    assert cells(output, "tiles") == [
        "tiles", "2.1", "6.8", "0.98", "1.7", "%", "broken"
    ]  # fmt: skip
    assert cells(output, "convergence") == ["convergence", "not", "asked"]


def test_without_replays_and_rungs_there_is_the_table_alone():
    output = shown(replace(SCENE, replay=(), rungs=()))
    assert "ladder" not in output
    assert "random numbers" not in output


def test_an_exact_scene_shows_what_the_comparison_leaves_out():
    masked = Metric(0.494, None, 0.6, True, "")
    exact = replace(SCENE, metrics={"masked_fraction": masked}, verdict="pass")
    output = shown(exact)
    assert cells(output, "pass") == ["box", "49%", "pass"]
    assert "edges: share of a picture without noise" in output
    assert "edges: share" not in shown(SCENE)


def test_no_line_is_broken_or_cut_at_120_columns():
    """The longest names there are: a scene's, a rung's; one line for each fact."""
    long = replace(RUNG, name="convergence, Mitsuba", sentence="")
    scenes = [
        replace(SCENE, name=f"whitted-spheres{i}", rungs=(long,) * 11, replay=(REPLAY,) * 2)
        for i in range(17)
    ]
    output = shown(*scenes)
    assert output.count("holds") == 17 * 11
    assert output.count("broken") == 17 * 2
    assert "…" not in output
