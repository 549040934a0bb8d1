"""`python -m reports`: default study, exit statuses, what an interrupt leaves."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from report_samples import scene, stopped_scene, write_results

from mitsuba_ref.command.validation import Validated
from reports import command
from reports.bench.store import Store
from reports.bench.study import Bench, find_study
from reports.look.results import read_results
from reports.trials import compared_scenes


@pytest.fixture(autouse=True)
def few_studies(monkeypatch):
    """The index of a test has these alone; others may have rows in the repository."""
    few = {name: find_study(name) for name in ("scenes", "proof")}
    monkeypatch.setattr(command, "available_studies", lambda: few)


def run(folder, *scenes, words=()):
    source = write_results(folder / "harness", list(scenes))
    cases = [word for entry in scenes for word in ("--case", entry["name"])]
    out = ["--out", str(folder / "out"), "--set", f"from={source}"]
    return command.main([*words, *cases, *out])


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        (["pass"], 0),
        (["pass", "fail"], 1),
        (["not-finite"], 3),
        (["not-finite", "fail"], 1),
    ],
)
def test_status_is_that_of_the_most_severe_verdict(tmp_path, capsys, verdicts, status):
    """Without a study, it is that of scenes; the pages are drawn and named either way."""
    made = [scene(f"s{index}", verdict) for index, verdict in enumerate(verdicts)]
    assert run(tmp_path, *made) == status
    assert str(tmp_path / "out/index.html") in capsys.readouterr().out
    assert (tmp_path / "out/scene_s0.html").exists()
    assert (tmp_path / "out/plotly.js").exists()
    # old rows, drawn again
    assert command.main(["--draw", "--out", str(tmp_path / "out")]) == status


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--case", "no-such-scene"], "no such file; names of scenes are analytic-shapes"),
        (["--set", "size=huge"], "possible are demo, test"),
        (["--set", "color=red"], "has no option 'color'"),
        (["proof", "--set", "seeds=2"], "expected 8 or more"),
        (["--set", "from=nowhere.json"], "nowhere.json: cannot be read"),
        (["no-such-study"], "no-such-study"),
        (["register", "--case", "bumps"], "case 'bumps' is unknown"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_2(tmp_path, capsys, words, said):
    assert command.main([*words, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert said in line
    assert not (tmp_path / "out/index.html").exists()


def test_a_scene_that_the_file_lacks_is_one_line(tmp_path, capsys):
    source = write_results(tmp_path, [scene("there", "pass")])
    words = ["--case", "gone", "--set", f"from={source}", "--out", str(tmp_path / "out")]
    assert command.main(words) == 2
    assert "no scene 'gone'; there are --case there" in capsys.readouterr().err


def test_an_interrupt_leaves_the_scenes_so_far(tmp_path, monkeypatch, capsys):
    """The harness compares in one process for all scenes; the second is interrupted."""
    results = read_results(
        write_results(tmp_path, [scene("cornell-box", "pass"), stopped_scene("bumps")])
    ).scenes
    done = []

    @contextmanager
    def validator(files, options, show):
        assert len(files) == 2 and options.checks == "statistics" and options.ladder

        def validate(path, progress):
            if done:
                raise KeyboardInterrupt
            done.append(path)
            grey = np.full((12, 16, 3), 0.5, np.float32)
            pixels = {"ours": grey, "reference": grey}
            return Validated(results[0], pixels)

        yield validate

    monkeypatch.setattr(compared_scenes, "validator", validator)
    words = ["scenes", "--case", "cornell-box", "--case", "bumps"]
    out = tmp_path / "out"
    assert command.main([*words, "--out", str(out)]) == 130
    said = capsys.readouterr()
    assert "interrupted, what ended is stored" in said.err
    assert "cornell-box" in said.out and "verdict" in said.out  # the harness's table
    assert Store(out / "data").read("scenes").distinct("case") == ["cornell-box"]
    assert (out / "scene_cornell-box.html").exists()
    assert (out / "data/scenes/cornell-box/results.json").exists()


def test_a_quick_run_leaves_record_and_pictures_of_the_full_one(tmp_path):
    """Its rows count after those of a full run; what they name must be theirs."""
    bench = Bench("scenes", folder=tmp_path)
    places = {
        compared_scenes.record_file(one, "box").as_posix()
        for one in (
            bench,
            replace(bench, quick=True),
            replace(bench, options={"size": "test"}),
            replace(bench, options={"from": "/a/b.json"}),
        )
    }
    assert places == {
        f"data/scenes/box{tag}/results.json"
        for tag in ("", "-quick", "-size=test", "-from=taken")
    }
    assert run(tmp_path, scene("s", "pass")) == 0
    table = Store(tmp_path / "out/data").read("scenes")
    assert all("s-from=taken" in r.value for r in table.where(quantity="picture"))
    assert "s-from=taken" in table.value(quantity="record")


def test_help_names_the_statuses_of_verdicts(capsys):
    with pytest.raises(SystemExit) as stopped:
        command.main(["--help"])
    said = capsys.readouterr().out
    assert stopped.value.code == 0
    assert "8  refused-by-us:" in said and "130  interrupted" in said
