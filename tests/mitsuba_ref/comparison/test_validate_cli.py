"""`python -m mitsuba_ref`: table, exit status, report; Mitsuba stands in for our side."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest
from mitsuba_stand_in import stand_in, write_scene

from mitsuba_ref.command.cli import main
from mitsuba_ref.speed.speed_against_accuracy import rungs
from reports.look.results import read_results


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def scene(tmp_path):
    return write_scene(tmp_path / "ball", width=24, height=18, spp=16)


def run(*arguments: object, ours=None) -> int:
    # a stand-in knows no random numbers that could be replayed
    words = [*map(str, arguments), "--size", "test", "--checks", "statistics"]
    return main(words, ours or stand_in())


def test_equal_renderers_pass_with_status_0(scene, capsys):
    assert run(scene) == 0
    output = capsys.readouterr().out
    row = next(line for line in output.splitlines() if "ball" in line)
    assert row.split()[0] == "ball"
    assert row.split()[-1] == "pass"
    assert "floor" in output


def test_a_broken_renderer_fails_with_status_1_and_the_reason(scene, capsys):
    assert run(scene, ours=stand_in(lambda picture: picture * 1.5)) == 1
    output = capsys.readouterr().out
    assert "fail ball: " in output
    assert "mean_difference" in output


def test_a_refused_scene_is_no_pass_and_the_others_go_on(scene, tmp_path, capsys):
    """The sentence in the table, no traceback; the good scene still passes."""
    refused = tmp_path / "refused.xml"
    refused.write_text(scene.read_text().replace('"sphere"', '"teapot"'))
    assert run(refused, scene, "--report", tmp_path / "report") == 10
    captured = capsys.readouterr()
    assert "refused-by-both refused: our renderer: " in captured.out
    assert "refused-by-both refused: Mitsuba, tried as well: " in captured.out
    assert "teapot" in captured.out
    assert "Traceback" not in captured.out + captured.err
    results = read_results(tmp_path / "report" / "results.json")
    assert [(s.name, s.verdict) for s in results.scenes] == [
        ("refused", "refused-by-both"),
        ("ball", "pass"),
    ]


def test_a_bug_in_our_renderer_is_a_verdict_of_that_scene(scene, capsys):
    def buggy(request):
        raise KeyError("spheres")

    assert run(scene, ours=buggy) == 5
    assert "unexpected KeyError: 'spheres'" in capsys.readouterr().out


def test_ctrl_c_shows_the_scenes_so_far(scene, tmp_path, capsys):
    """The first scene's result and report are not lost with the second scene."""
    second = write_scene(tmp_path / "second", width=24, height=18, spp=16)
    perfect = stand_in()

    def interrupted(request):
        if "second" in request.path:
            raise KeyboardInterrupt
        return perfect(request)

    report = tmp_path / "report"
    assert run(scene, second, "--report", report, ours=interrupted) == 130
    assert "ball" in capsys.readouterr().out
    assert [s.name for s in read_results(report / "results.json").scenes] == ["ball"]


def test_a_wrong_proof_file_is_a_verdict_of_that_scene(scene, capsys):
    scene.with_name("proof.toml").write_text("titel = 1")
    assert run(scene) == 11
    assert "unknown field `titel`; known: title" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["--size", "huge"],
        ["--spp", "0"],
        ["-D", "width"],
        ["--threads", "x"],
        ["--threads", "1"],
        ["gone.xml"],
    ],
    ids=" ".join,
)
def test_bad_usage_is_status_2(scene, capsys, arguments):
    assert main([*arguments, str(scene)], stand_in()) == 2
    assert capsys.readouterr().err


def test_help_is_status_0(capsys):
    assert main(["--help"]) == 0
    assert "--report" in capsys.readouterr().out


def test_report_holds_the_pictures_that_were_compared(scene, tmp_path):
    report = tmp_path / "report"
    assert run(scene, "--report", report, "--seed", 7) == 0
    data = json.loads((report / "results.json").read_text())
    (result,) = data["scenes"]
    assert (result["width"], result["height"], result["spp"]) == (24, 18, 16)
    assert result["seed"] == 7
    assert result["settings"]["filter"] == "box on both sides"
    assert result["seconds"]["reference_threads"] >= 2
    pictures = {kind: np.load(report / name) for kind, name in result["images"].items()}
    assert set(pictures) == {"ours", "reference", "reference_other_seed"}
    for picture in pictures.values():
        assert picture.shape == (18, 24, 3)
        assert picture.dtype == np.float32
    assert not np.array_equal(pictures["reference"], pictures["reference_other_seed"])


def test_two_scenes_of_one_name_get_two_names(tmp_path):
    first = write_scene(tmp_path / "a" / "ball", width=12, height=11, spp=4)
    second = write_scene(tmp_path / "b" / "ball", width=12, height=11, spp=4)
    report = tmp_path / "report"
    run(first, second, "--report", report)
    names = [scene.name for scene in read_results(report / "results.json").scenes]
    assert names == ["ball", "ball-2"]


def test_scene_without_proof_file_is_rendered_as_it_says(scene, tmp_path):
    """No size of ours is pushed on a file that has its own; -D still reaches it."""
    scene.with_name("proof.toml").unlink()
    report = tmp_path / "report"
    assert run(scene, "-D", "width=20", "--report", report) == 0
    (result,) = read_results(report / "results.json").scenes
    assert (result.width, result.height, result.spp) == (20, 24, 16)


def test_a_sample_count_given_by_D_goes_before_the_proof_s(scene, tmp_path, capsys):
    """The file's $spp and the number in both requests are one thing."""
    report = tmp_path / "report"
    assert run(scene, "-D", "spp=9", "--report", report) == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.spp == 9
    assert result.settings["reference_spp"] == "9"
    assert run(scene, "-D", "spp=many") == 11
    assert "-D spp=many: a whole number of 1 or more" in capsys.readouterr().out


def test_a_filter_of_the_file_s_own_is_compared_too(scene, tmp_path):
    """With the box all is right: one number alone can tell that the filter is wrong."""
    scene.write_text(scene.read_text().replace('rfilter type="box"', 'rfilter type="tent"'))
    perfect = stand_in()

    def wrong_filter(request):
        picture = perfect(request)
        if request.kind == "image" and not request.box_filter:
            picture.arrays["pixels"] = np.roll(picture.pixels, 1, axis=0)
        return picture

    report = tmp_path / "report"
    assert run(scene, "--report", report) == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.metrics["rmse_with_filter"].passed
    assert "took the box" in result.commands["ours"]
    assert "Changed on ours: " in result.reference_note
    assert run(scene, "--report", report, ours=wrong_filter) == 1
    (result,) = read_results(report / "results.json").scenes
    assert [reason.split()[0] for reason in result.reasons] == ["rmse_with_filter"]


def test_a_still_scene_without_proof_needs_no_floor_for_its_filter(tmp_path):
    """Nothing is random in it, which only Mitsuba's pictures tell: the floor would be 0."""
    scene = write_scene(tmp_path / "still", deterministic=True)
    scene.with_name("proof.toml").unlink()
    scene.write_text(scene.read_text().replace('rfilter type="box"', 'rfilter type="tent"'))
    report = tmp_path / "report"
    assert run(scene, "-D", "spp=1", "--report", report) == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.deterministic
    assert "rmse_with_filter" not in result.metrics


def test_the_command_of_our_side_starts_rays_as_the_comparison_did(scene, tmp_path):
    report = tmp_path / "report"
    run(scene, "--report", report)
    (result,) = read_results(report / "results.json").scenes
    words = shlex.split(result.commands["ours"])
    assert words[:3] == ["python", "-m", "renderer"]
    assert words[words.index("--ray-offset") + 1] == "mitsuba"
    assert "#" not in result.commands["ours"]


def test_deterministic_scene_keeps_its_filter_and_has_no_noise(tmp_path):
    scene = write_scene(tmp_path / "still", deterministic=True)
    report = tmp_path / "report"
    assert run(scene, "--report", report, "--ladder") == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.deterministic
    assert result.ladder is None
    assert result.metrics["rmse"].value == 0.0
    assert result.settings["filter"] == "as in the scene file"


def test_ladder_measures_both_renderers_at_the_same_rungs(scene, tmp_path):
    report = tmp_path / "report"
    assert run(scene, "--ladder", "--report", report) == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.ladder is not None
    points = result.ladder.points
    for renderer in ("lightproof", "mitsuba scalar_rgb"):
        mine = [point for point in points if point.renderer == renderer]
        assert [point.spp for point in mine] == [1, 2, 4, 8]
        # 8 times the samples: 0.37 of the error, with the reference's, give or take noise.
        assert mine[-1].rmse < 0.5 * mine[0].rmse
    assert "whose own RMSE is about" in result.ladder.note


def test_rungs_double_and_end_at_half_of_the_scene_s_samples():
    assert rungs(64) == [2, 4, 8, 16, 32]
    assert rungs(3) == [1]


def test_second_run_takes_mitsuba_s_pictures_from_the_cache(scene, tmp_path):
    report = tmp_path / "report"
    settings = []
    for _ in range(2):
        run(scene, "--report", report)
        (result,) = read_results(report / "results.json").scenes
        settings.append(result.settings["reference_seconds"])
    assert "from the cache" not in settings[0]
    assert "from the cache" in settings[1]
