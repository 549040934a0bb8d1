"""Records in the repository: which are kept, what a fresh clone shows, over commits."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import speed_accuracy_sample
from report_samples import scene, write_results

from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import to_json
from reports.errors import ReportError
from reports.history import command, kept
from reports.history.kept import keep, partial
from reports.history.measures import MEASURES, values_of
from reports.history.page import history_page
from reports.history.versions import NOT_COMMITTED, versions_of
from reports.needs.record import SCHEMA as NEEDS_SCHEMA
from reports.needs.record import Loss, SceneNeeds
from reports.records import measured
from reports.records.measured import newest
from reports.records.results import read_results
from reports.scenes_page.page import results_page
from reports.soak.record import Part, Session, Soak, Step
from reports.speed_accuracy.summary import efficiencies

REPOSITORY = Path(measured.__file__).parents[1] / "measured"


def record(day: int, words: str = "", **more: Any) -> dict[str, Any]:
    created = f"2026-11-{day:02}T00:00:00+00:00"
    words = f"python -m reports.x {words}".strip()
    return {"schema": 1, "created": created, "commit": "abc", "command": words, **more}


def write(path: Path, content: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


# -------------------------------------------------------------------------------- newest


def test_the_newer_of_two_records_is_read(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(measured, "MEASURED", tmp_path / "kept")
    mine, theirs = tmp_path / "out" / "a.json", tmp_path / "kept" / "a.json"
    assert newest(mine) == mine  # neither is there
    write(theirs, record(2))
    assert newest(mine) == theirs
    write(mine, record(1))
    assert newest(mine) == theirs
    write(mine, record(3))
    assert newest(mine) == mine
    theirs.write_text("{")
    with pytest.raises(ReportError, match=r"kept/a\.json: no record"):
        newest(mine)


# ------------------------------------------------------------------------------- keeping


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("python -m reports.x --out /tmp/charts3", "python -m reports.x --out charts3"),
        ("python -m reports.x --out=/home/a/b/", "python -m reports.x --out=b/"),
        (f"in {REPOSITORY}/soak.json:3: x", "in reports/measured/soak.json:3: x"),
        ('from "/a/b/.venv/bin/python"', 'from ".venv/bin/python"'),
        ('File "/usr/lib/site-packages/x.py"', 'File "site-packages/x.py"'),
        ("a:/home/b/c,/tmp/d/e `/opt/f/g`", "a:c,e `g`"),
        ("1.5 W/m^2/sr, scenes/a/scene.xml, a / b", None),
        ("data:image/jpeg;base64,/9j/4AAQ/a https://a.b/c/d //x/y", None),
    ],
)
def test_a_kept_record_has_no_paths_of_the_machine(tmp_path, text, shown) -> None:
    """They say nothing to others, and tell whose machine it was."""
    content = record(3, rows=[{"note": text, "n": 1.5}, None])
    write(tmp_path / "data" / "matrix.json", content)
    list(keep(tmp_path / "data", tmp_path))
    found = json.loads((tmp_path / "matrix.json").read_text())
    expected = text if shown is None else shown
    assert found == {**content, "rows": [{"note": expected, "n": 1.5}, None]}


@pytest.mark.parametrize("path", sorted(REPOSITORY.glob("*.json")), ids=lambda p: p.name)
def test_the_repositorys_records_have_no_paths_of_a_machine(path: Path) -> None:
    found = re.findall(
        r"(?<![\w.~-])/(?:home|root|tmp|Users|work)/.{,40}", path.read_text()
    )
    assert found == []


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("matrix.json", record(1, "--jobs 2"), ""),
        ("matrix.json", record(1, "--only one"), "it was measured with --only"),
        ("limits.json", record(1, "--quick"), "it was measured with --quick"),
        ("benchmark.json", record(1, "--size=64"), "it was measured with --size=64"),
        ("accelerators.json", record(1), "it was measured without --full"),
        ("accelerators.json", record(1, "--full --out a"), ""),
        ("needs.json", record(1, "cornell"), "it was measured without all"),
        ("needs.json", record(1, "all -Dwidth=8"), "it was measured with -Dwidth=8"),
        ("needs.json", record(1, "all", whole=True), ""),
        (
            "needs.json",
            record(1, "all", whole=False),
            "it is not whole: something was refused, or the command was interrupted",
        ),
        *(
            ("speed_accuracy.json", record(1, word), f"it was measured with {word}")
            for word in ("--reference=64", "--threads=2", "--full")
        ),
        ("calibration.json", record(1, "cornell-box"), "it was measured on some scenes"),
        ("calibration.json", record(1, "--out reports/out"), ""),
        (
            "matrix.json",
            {**record(1), "commit": "abc-dirty"},
            "it is of no commit (abc-dirty)",
        ),
        ("matrix.json", {"created": "2026"}, "it is of no commit (unknown)"),
    ],
)
def test_parts_and_changed_sources_are_not_kept(name, content, reason) -> None:
    assert partial(name, content) == reason


@pytest.mark.parametrize(
    "file",
    [
        "mitsuba_ref/mutations/__main__.py",
        "mitsuba_ref/false_alarms/__main__.py",
        "mitsuba_ref/expected_failures/__main__.py",
        *(
            f"reports/commands/{name}.py"
            for name in (
                "benchmark",
                "calibration",
                "limits",
                "speed_accuracy",
            )
        ),
        "reports/needs/command.py",
        "reports/soak/command.py",
    ],
)
def test_options_of_kept_records_have_no_short_forms(file: str) -> None:
    """`--qui` would be `--quick` to the command, and unknown to `partial`."""
    text = (REPOSITORY.parents[1] / file).read_text()
    assert text.count("ArgumentParser(") == text.count("allow_abbrev=False") == 1


def test_whole_and_newer_records_are_kept(tmp_path: Path) -> None:
    target = tmp_path / "kept"
    write(tmp_path / "data" / "matrix.json", record(2, rows=[]))
    write(tmp_path / "data" / "proof" / "register.json", record(2, "--quick"))
    rows = [{"name": "a", "picture": "x" * 1000}]
    write(tmp_path / "data" / "limits.json", record(2, rows=rows))
    lines = list(keep(tmp_path / "data", target))
    assert [line.rpartition(": ")[2] for line in lines] == [
        "kept",
        "not kept, it was measured with --quick",
        "kept",
    ]
    assert sorted(path.name for path in target.iterdir()) == ["limits.json", "matrix.json"]
    assert "xxx" not in (target / "limits.json").read_text()  # no pictures
    again = list(keep(tmp_path / "data", target))
    assert all("not kept, " in line for line in again)
    (tmp_path / "data" / "matrix.json").write_text("[1")
    with pytest.raises(ReportError, match=r"matrix\.json: no record"):
        list(keep(tmp_path / "data", target))


def test_nothing_to_keep_is_said(tmp_path: Path, capsys) -> None:
    assert command.main(["--keep", "--out", str(tmp_path)]) == 0
    assert "there is no record" in capsys.readouterr().out.replace("\n", "")


# ------------------------------------------------------------------------- over commits


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(name, raising=False)
    git(tmp_path, "init", "-q")
    return tmp_path


def git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    run = subprocess.run(
        ["git", *who, *words], cwd=folder, check=True, capture_output=True, text=True
    )
    return run.stdout


def test_every_committed_version_is_found_oldest_first(clone: Path) -> None:
    path = clone / "measured" / "limits.json"
    for day, alarms in ((1, 3), (2, 1)):
        rows = [{"verdict": "ALARM"}] * alarms + [{"verdict": "as said"}] * 5
        write(path, record(day, rows=rows))
        git(clone, "add", ".")
        git(clone, "commit", "-qm", "measure")
    path.write_text("{")
    git(clone, "commit", "-qam", "spoil")  # is left out
    write(path, record(3, rows=[]))
    found = versions_of(path)
    assert [one.created[8:10] for one in found] == ["01", "02", "03"]
    assert found[-1].commit == NOT_COMMITTED
    assert found[0].commit == git(clone, "log", "--format=%h", "--reverse").split()[0]
    (measure,) = [one for one in MEASURES if one.record == "limits.json"]
    values = [values_of(measure, one.content)["not as the atlas says"] for one in found]
    assert values == [3, 1, 0]
    page = history_page({"limits.json": found})
    assert "The atlas of limits" in page and found[0].commit in page
    assert "Not measured whole so far" in page and "matrix.json" in page


def test_outside_of_a_clone_it_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    monkeypatch.setattr(command, "MEASURED", tmp_path / "measured")
    assert command.main(["--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "is not in a git clone" in said
    assert not (tmp_path / "history.html").exists()


def test_without_git_it_is_the_same_sentence(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setenv("PATH", "")
    assert command.main(["--out", str(tmp_path)]) == 2
    assert "or git is missing" in capsys.readouterr().err


def test_records_that_are_not_committed_leave_the_commit_clean(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a second run of the same commit would be of no commit."""
    source = clone / "a" / "b" / "machine.py"
    write(source, "")
    git(clone, "add", ".")
    git(clone, "commit", "-qm", "begin")
    monkeypatch.setattr(machine, "__file__", str(source))
    clean = machine.current_commit()
    write(clone / "reports" / "measured" / "soak.json", record(1))
    assert machine.current_commit() == clean != "unknown"
    write(clone / "reports" / "other.json", record(1))
    assert machine.current_commit() == f"{clean}-dirty"


# ----------------------------------------------------------------- the repository's own


@pytest.mark.parametrize("path", sorted(REPOSITORY.glob("*.json")), ids=lambda p: p.name)
def test_the_repositorys_records_are_whole_small_and_have_numbers(path: Path) -> None:
    content = json.loads(path.read_text())
    assert path.name in kept.PARTIAL
    assert partial(path.name, content) == ""
    assert content["machine"]["cpu"] and content["created"]
    assert path.stat().st_size < 500_000
    measures = [one for one in MEASURES if one.record == path.name]
    assert all(values_of(one, content) for one in measures)


def test_a_fresh_clone_shows_the_repositorys_mutations(tmp_path: Path, monkeypatch) -> None:
    """`make proof` measures neither mutations nor false alarms."""
    from reports.proof_page.record import MATRIX, read_matrix

    monkeypatch.setattr(measured, "MEASURED", REPOSITORY)
    found = newest(tmp_path / "data" / MATRIX)
    assert found == REPOSITORY / MATRIX
    assert len(read_matrix(found).rows) > 50


def test_needs_are_drawn_without_their_pictures(tmp_path: Path, monkeypatch) -> None:
    from reports.commands import pages

    loss = {field.name: 0.5 for field in dataclasses.fields(Loss)}
    loss |= {"words": ["depth=2"], "sentence": "s", "tiles_off": 1, "tiles": 4}
    needs = {field.name: 8 for field in dataclasses.fields(SceneNeeds)}
    needs |= {"scene": "box", "size": [8, 6], "losses": [loss], "least": loss}
    needs |= {"absent": [], "claims": [], "command": "c", "content": "c"}
    kept = record(1, scenes=[needs], whole=True, machine={}, versions={}) | {
        "schema": NEEDS_SCHEMA
    }
    write(tmp_path / "needs.json", kept)
    monkeypatch.setattr(measured, "MEASURED", tmp_path)
    pages._needs(tmp_path / "out")
    page = (tmp_path / "out" / "needs.html").read_text()
    assert "The least model" in page and "<img" not in page


def test_the_index_names_what_was_soaked(tmp_path: Path) -> None:
    part = Part().begun(Session("now", "abc", "cpu")).after(Step(3, faults=("a",)), 7200.0)
    results = read_results(write_results(tmp_path, [scene("box", "pass")]))
    page = results_page(results, tmp_path, soak=Soak(parts={"rays": part}), history=True)
    assert (
        'href="soak.html"' in page
        and "1 fault open, 0 found and mended" in page
        and "120 min" in page
    )
    assert 'href="history.html"' in page
    assert "soak.html" not in results_page(results, tmp_path)


def test_what_draws_a_scene_fastest_is_a_curve_too() -> None:
    (measure,) = [one for one in MEASURES if one.record == "speed_accuracy.json"]
    values = values_of(measure, json.loads(to_json(speed_accuracy_sample.record())))
    rows = efficiencies(speed_accuracy_sample.record())
    assert values == {row.name: row.mean for row in rows} and values
