"""Measurements that the repository keeps: without paths, small, and over commits."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from report_samples import scene, write_results

from mitsuba_ref.records import machine
from reports import command
from reports.bench.rows import Done, Row, Run, Table
from reports.bench.store import Store
from reports.bench.study import Study
from reports.bench.without_paths import without_paths
from reports.errors import ReportError
from reports.pages.history_page import MOST, curves_of, history_page
from reports.records import measured
from reports.records.measured import newest
from reports.records.results import read_results
from reports.scenes_page.page import results_page

REPOSITORY = Path(measured.__file__).parents[1] / "measured"
KEPT = sorted([*REPOSITORY.glob("*.json"), *REPOSITORY.glob("*.jsonl")])


def record(day: int) -> dict[str, Any]:
    return {"schema": 1, "created": f"2026-11-{day:02}T00:00:00+00:00", "commit": "abc"}


def write(path: Path, content: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


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


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("python -m reports.x --out /tmp/charts3", "python -m reports.x --out charts3"),
        ("python -m reports.x --out=/home/a/b/", "python -m reports.x --out=b/"),
        (f"in {REPOSITORY}/soak.jsonl:3: x", "in reports/measured/soak.jsonl:3: x"),
        ('from "/a/b/.venv/bin/python"', 'from ".venv/bin/python"'),
        ('File "/usr/lib/site-packages/x.py"', 'File "site-packages/x.py"'),
        ("a:/home/b/c,/tmp/d/e `/opt/f/g`", "a:c,e `g`"),
        ("1.5 W/m^2/sr, scenes/a/scene.xml, a / b", None),
        ("data:image/jpeg;base64,/9j/4AAQ/a https://a.b/c/d //x/y", None),
    ],
)
def test_a_row_has_no_paths_of_the_machine(text: str, shown: str | None) -> None:
    """They say nothing to others, and tell on which machine it was measured."""
    expected = text if shown is None else shown
    assert without_paths({"a": [text, 1.5, None]}) == {"a": [expected, 1.5, None]}


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.name)
def test_what_the_repository_keeps_is_small_and_has_no_paths(path: Path) -> None:
    text = path.read_text()
    found = re.findall(r"(?<![\w.~-])/(?:home|root|tmp|Users|work)/.{,40}", text)
    assert found == []
    assert len(text) < 500_000


@pytest.mark.parametrize(
    "name", sorted(path.stem for path in KEPT if path.suffix == ".jsonl")
)
def test_kept_runs_are_full_and_of_a_commit(name: str) -> None:
    table = Store(Path("nowhere")).everything(name)
    assert table and {row.study for row in table} == {name}
    for run in table.runs.values():
        assert run.full and run.machine["cpu"] and run.created
        assert run.commit != "unknown" and not run.commit.endswith("-dirty")


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


# ------------------------------------------------------------------------ over commits


def table(*runs: tuple[str, list[Row]]) -> Table:
    """Return rows of runs, each of a commit and the next day."""
    found = {
        name: Run(run=name, created=f"2026-01-{day:02}", command="c", commit=name)
        for day, (name, _) in enumerate(runs, 1)
    }
    rows = [row for name, rows in runs for row in (of_run(row, name) for row in rows)]
    return Table(tuple(rows), found)


def of_run(row: Row, run: str) -> Row:
    return Row(
        case=row.case,
        quantity=row.quantity,
        contender=row.contender,
        value=row.value,
        at=row.at,
        run=run,
    )


def time_of(case: str, contender: str, value: float) -> Row:
    return Row(case=case, contender=contender, quantity="time", value=value)


def test_a_curve_is_a_contender_and_its_mean_over_cases() -> None:
    """A run that measured one case alone leaves the other as it was."""
    found = table(
        ("r1", [time_of("a", "x", 1.0), time_of("b", "x", 4.0), time_of("a", "y", 5.0)]),
        ("r2", [time_of("a", "x", 9.0)]),
    )
    curves = curves_of(list(found.runs.values()), found)
    assert curves == {"x": [pytest.approx(2.0), pytest.approx(6.0)], "y": [5.0, 5.0]}
    alone = found.where(contender="x")
    assert list(curves_of(list(found.runs.values()), alone)) == ["a", "b"]
    many = table(("r1", [time_of(str(k), "", 2.0) for k in range(MOST + 1)]))
    curves = curves_of(list(many.runs.values()), many)
    assert curves == {"mean of all": [pytest.approx(2.0)]}


def test_the_page_draws_what_was_measured_twice(tmp_path: Path) -> None:
    given = {"sentence": "S?", "minutes": 1, "measure": lambda case, bench: iter(())}
    twice, once = Study(title="Twice", **given), Study(title="Once", **given)
    faulty = Study(title="Faulty", headlines=("faults",), **given)
    rows = [time_of("a", "", 1.0), Row(case="a", quantity="fault", value="a hole")]
    page = history_page(
        {
            "twice": (twice, table(("r1", rows), ("r2", rows))),
            "once": (once, table(("r1", rows))),
            "faulty": (faulty, table(("r1", rows), ("r2", rows[:1]))),
        }
    )
    assert "Twice: time" in page and page.count("data-figure=") == 2
    assert "Faulty: faults" in page and "Measured once so far: Once" in page
    assert "<code>r2</code>" in page


def test_all_pages_are_drawn_from_what_is_kept(tmp_path: Path, capsys) -> None:
    assert command.main(["--draw", "--out", str(tmp_path)]) == 0
    assert {"history.html", "needs.html", "soak.html"} <= {
        p.name for p in tmp_path.iterdir()
    }
    assert "faults" in (tmp_path / "history.html").read_text()


def test_pictures_of_a_quick_run_stand_beside_kept_numbers(tmp_path: Path) -> None:
    """The kept rows have none; the page says of which run the numbers are."""
    store = Store(tmp_path / "data", tmp_path / "measured")
    for run, quick in (("full", False), ("quick", True)):
        rows = [time_of("a", "x", 1.0 + quick)]
        rows += [Row(case="a", quantity="picture", value="a.png")] * quick
        circumstances = Run(run=run, created=run, command="c", commit="c", quick=quick)
        lines = [of_run(row, run) for row in rows]
        store.append("s", [circumstances, *lines, Done(done="a", run=run, seconds=1.0)])
    found = store.read("s")
    assert found.value(quantity="time") == 1.0
    assert found.value(quantity="picture") == "a.png"
    assert found.newest is not None and found.newest.run == "full"


# ----------------------------------------------------------------- the repository's own


def test_a_fresh_clone_shows_the_repositorys_mutations(tmp_path: Path, monkeypatch) -> None:
    """`make proof` measures neither mutations nor false alarms."""
    from reports.proof_page.record import MATRIX, read_matrix

    monkeypatch.setattr(measured, "MEASURED", REPOSITORY)
    found = newest(tmp_path / "data" / MATRIX)
    assert found == REPOSITORY / MATRIX
    assert len(read_matrix(found).rows) > 50


def test_the_index_names_what_was_soaked(tmp_path: Path) -> None:
    results = read_results(write_results(tmp_path, [scene("box", "pass")]))
    page = results_page(results, tmp_path, soak="1 fault open", history=True)
    assert 'href="soak.html"' in page and 'href="history.html"' in page
    assert "1 fault open." in page
    assert "soak.html" not in results_page(results, tmp_path)
