"""The terminal shows every replay and every rung, and fits seventeen scenes."""

from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.records.failures import failures
from mitsuba_ref.records.results import (
    AovResult,
    DivergentPixel,
    Finite,
    Metric,
    Parting,
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
    "convergence", True, None, None, None, None, None, "", "Not tested: no noise."
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
    assert cells(output, "convergence") == ["convergence", "not", "tested"]


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


PARTING = Parting(
    72, 15, 3, "bounce 0", "unblocked light", "0.6059724", "0.3029862", 0.5, 1e-5, False,
    "a value",
)  # fmt: skip
DEFECT = replace(REPLAY, partings=(PARTING,), sentence="long " * 150, rmse=2e-4)


def test_what_failed_is_a_table_with_limits_and_not_a_sentence_of_700_characters():
    """Each number beyond its limit has a row: value, floor, limit."""
    bias = Metric(3.96, 1.0, 2.25, False, "distance of tile means")
    fine = Metric(0.1, 0.1, 0.2, True, "fine")
    scene = replace(
        SCENE, replay=(DEFECT,), rungs=(), metrics={"tile_bias": bias, "rmse": fine},
        reasons=(DEFECT.sentence,),
    )  # fmt: skip
    output = shown(scene)
    names = "tile_bias; replay at 16 spp: diverged; replay at 16 spp: RMSE"
    assert f"fail box: {names}\n" in output
    table = output.partition(names)[2]
    assert cells(table, "tile_bias")[:4] == ["tile_bias", "3.96", "1", "2.25"]
    assert cells(table, "16 spp: diverged")[5:7] == ["3", "2"]
    assert cells(table, "16 spp: RMSE")[5:7] == ["0.0002", "1e-05"]
    assert "long" not in output
    assert max(map(len, output.splitlines())) <= 120


def test_every_kind_of_failure_has_a_row():
    """One that is missing would make a failed scene look as if nothing had failed."""
    aov = AovResult("depth", 0.5, 1e-3, False, "relative", 90, 10)
    scene = SceneResult(
        name="box",
        verdict="fail",
        finite=Finite(ours_nan=2, reference_inf=1),
        metrics={"ssim": Metric(0.1, 0.9, None, None, ""), "rmse": FAILED},
        aovs=(aov, replace(aov, name="uv", passed=True)),
        replay=(REPLAY, replace(REPLAY, spp=1, divergent=0), replace(REPLAY, passed=True)),
        rungs=(replace(RUNG, passed=False), SHIFT),
    )
    found = {one.quantity: (one.value, one.limit) for one in failures(scene)}
    assert found == {
        "NaN or infinite values": (3, 0),
        "rmse": (0.3, 0.2),
        "AOV depth": (0.5, 1e-3),
        "replay at 16 spp: diverged": (3, 2),
        "replay at 1 spp": (None, None),  # the file says so, its numbers do not
        "rung tiles": (2.125, 6.75),
    }


FAILED = Metric(0.3, 0.1, 0.2, False, "distance")


def test_a_step_that_differs_is_one_line_with_both_values_error_and_limit():
    """The same pixel may be listed and traced for the verdict: it is one line."""
    pixel = replace(REPLAY.listed[0], parting=PARTING, cause="long " * 150)
    replay = replace(DEFECT, listed=(pixel,))
    output = shown(replace(SCENE, replay=(replay,), rungs=()))
    assert output.count("0.6059724") == 1
    assert cells(output, "0.6059724") == [
        "16", "72,15", "3", "bounce", "0", "unblocked", "light", "0.6059724", "0.3029862",
        "0.5", "1e-05", "defect",
    ]  # fmt: skip
    assert "box: unblocked light differs: likely a value" in output
    assert "long" not in output


def test_what_is_not_judged_does_not_look_as_if_it_were():
    """SSIM and FLIP stand in the row of the verdict: in brackets, with a word on these."""
    output = shown(replace(SCENE, metrics={"flip": Metric(0.9, 0.1, None, None, "")}))
    heading = cells(output, "verdict")
    assert {"(SSIM)", "(FLIP)", "RMSE"} <= set(heading)
    assert "in brackets: shown, not judged" in output


def test_where_all_pixels_diverged_no_others_have_an_error():
    """An RMSE of 0 of no pixels looks like agreement."""
    every = replace(REPLAY, divergent=2400, rmse=0.0)
    output = shown(replace(SCENE, replay=(every,), rungs=()))
    assert cells(output, "broken") == ["box", "16", "2400", "2", "2400", "1e-05", "broken"]


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
