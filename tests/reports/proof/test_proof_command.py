"""`python -m reports.proof`: what it measures, what it draws, and its exit status."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import proof_samples as sample
import pytest
from report_samples import scene as rendered_scene
from report_samples import write_results

from mitsuba_ref.expected_failures import ExpectedFailure
from mitsuba_ref.expected_failures import __main__ as register_command
from mitsuba_ref.false_alarms import __main__ as alarms_command
from mitsuba_ref.mutations import __main__ as mutations_command
from reports.commands import proof as command
from reports.commands import report as cli
from reports.errors import ReportError
from reports.proof_page import run as proof_run
from reports.proof_page.record import ALARMS, MATRIX, read_register
from reports.proof_page.run import results_file

HOLE = sample.matrix(sample.mutation("gamma-twice", sample.seen("replay", False)))


def test_page_is_drawn_again_and_linked_from_the_index(tmp_path: Path) -> None:
    """`--from` measures nothing; the index in the same folder gets the three sentences."""
    data = tmp_path / "data"
    write_results(data, [rendered_scene("one", "pass")])
    source = sample.write_proof(data / "proof", sample.proven("box"))
    (data / "matrix.json").write_text(json.dumps(sample.matrix()))
    assert command.main(["--from", str(source), "--out", str(tmp_path)]) == 0
    assert "✓ first" in (tmp_path / "proof.html").read_text()
    index = (tmp_path / "index.html").read_text()
    assert '<a href="proof.html">' in index
    assert "Of 1 defects that were built in on purpose the tests catch 1" in index


def test_older_proof_is_drawn_beside_a_newer_one(tmp_path: Path) -> None:
    """`--from` with a file of another folder: that one is on the page in the end."""
    write_results(tmp_path / "data", [rendered_scene("one", "pass")])
    sample.write_proof(tmp_path / "data/proof", sample.proven("newer"))
    source = sample.write_proof(tmp_path / "old", sample.proven("older"))
    assert command.main(["--from", str(source), "--out", str(tmp_path)]) == 0
    assert "Title of older" in (tmp_path / "proof.html").read_text()


def test_fault_is_exit_status_1_here_and_in_the_report(tmp_path: Path) -> None:
    data = tmp_path / "data"
    results = write_results(data, [rendered_scene("one", "pass")])
    source = sample.write_proof(data / "proof", matrix=HOLE)
    assert command.main(["--from", str(source), "--out", str(tmp_path)]) == 1
    assert cli.main(["--from", str(results), "--out", str(tmp_path)]) == 1
    assert "✗ 1 thing is not as expected" in (tmp_path / "index.html").read_text()


def test_damaged_record_leaves_the_old_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "proof.html").write_text("the old page")
    broken_file = tmp_path / "broken.json"
    broken_file.write_text("{")
    assert command.main(["--from", str(broken_file), "--out", str(tmp_path)]) == 2
    assert (tmp_path / "proof.html").read_text() == "the old page"
    assert "broken.json:1: not JSON" in capsys.readouterr().err


@pytest.mark.parametrize(
    "beside", ["--quick", "--mutations", "--false-alarms", "--seeds=9"]
)
def test_from_measures_nothing(capsys: pytest.CaptureFixture[str], beside: str) -> None:
    with pytest.raises(SystemExit) as stopped:
        command.main(["--from", "results.json", beside])
    assert stopped.value.code == 2
    assert "--from draws old records" in capsys.readouterr().err


class Commands:
    """Stands in for the harness and for the commands that are run."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, status: int = 0) -> None:
        self.given: list[list[str]] = []
        self.status = status
        monkeypatch.setattr(proof_run.harness, "main", self.harness)
        monkeypatch.setattr(proof_run.subprocess, "run", self.run)

    def harness(self, words: list[str]) -> int:
        self.given.append(words)
        if self.status != 130:
            folder = Path(words[words.index("--report") + 1])
            sample.write_proof(folder, sample.proven("box"))
        return self.status

    def run(self, words: list[str]) -> Any:
        self.given.append(words[2:])
        target = Path(words[words.index("--out") + 1])
        files = {"expected_failures": sample.register(), "false_alarms": sample.alarms()}
        name = words[2].rpartition(".")[2]
        if name == "mutations":
            target, files[name] = target / "matrix.json", sample.matrix()
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(json.dumps(files[name]))
        return type("Done", (), {"returncode": self.status})()


def test_command_measures_what_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = Commands(monkeypatch)
    monkeypatch.setattr(proof_run, "usable_cores", lambda: 3)
    data = str(tmp_path / "data")
    words = ["--out", str(tmp_path), "--quick", "--seeds", "12", "--mutations"]
    assert command.main([*words, "--false-alarms"]) == 0
    register, alarms = f"{data}/proof/register.json", f"{data}/false_alarms.json"
    causes = ["--causes", "2"]
    assert ran.given == [
        ["--report", f"{data}/proof", "--size", "test", "--seeds", "12", *causes],
        ["mitsuba_ref.expected_failures", "--quick", "--out", register],
        ["mitsuba_ref.mutations", "--jobs", "3", "--out", data],
        ["mitsuba_ref.false_alarms", "--pairs", "20", "--out", alarms],
    ]
    assert "✓ first" in (tmp_path / "proof.html").read_text()
    ran.given.clear()
    assert command.main(["--out", str(tmp_path)]) == 0
    assert ran.given[0][2:] == ["--size", "demo", "--seeds", "8", "--causes", "8"]
    assert ran.given[1:] == [["mitsuba_ref.expected_failures", "--out", register]]
    # The records of the run before are still there, and on the page.
    page = (tmp_path / "proof.html").read_text()
    assert "✓ first" in page and "Not measured in this run." not in page


def test_studies_write_where_the_page_looks() -> None:
    """Without `--out`: `make proof` shows what these commands measured last."""
    data = results_file(cli.DEFAULT_OUT / "data").parent.parent
    assert data / MATRIX == mutations_command.WHOLE / "matrix.json"
    assert data / ALARMS == alarms_command.RECORD
    # A few mutations must not replace the whole matrix there.
    assert mutations_command.A_PART not in (data, data / "proof")


@pytest.mark.parametrize(("status", "expected"), [(130, 130), (2, 2)])
def test_stopped_harness_draws_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int, expected: int
) -> None:
    Commands(monkeypatch, status)
    assert command.main(["--out", str(tmp_path)]) == expected
    assert not (tmp_path / "proof.html").exists()


def test_study_that_breaks_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Commands(monkeypatch, status=3)
    assert command.main(["--out", str(tmp_path)]) == 2
    assert "mitsuba_ref.expected_failures ended with status 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "there", "made"),
    [
        ([], False, True),
        ([], True, False),
        (["scenes/a"], False, False),
        (["--proof", "scenes/a"], True, True),
        (["--no-proof"], False, False),
    ],
)
def test_report_makes_the_proof_once(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    there: bool,
    made: bool,
) -> None:
    """`python -m reports` on a fresh clone draws this page as well, at the quick sizes."""
    asked: list[Path] = []

    def harness(words: list[str]) -> int:
        write_results(tmp_path / "data", [rendered_scene("one", "pass")])
        return 0

    def prove(data: Path, settings: proof_run.ProofSettings) -> int:
        assert settings == proof_run.QUICK
        asked.append(data)
        sample.write_proof(data / "proof")
        return 0

    monkeypatch.setattr(cli.harness, "main", harness)
    monkeypatch.setattr(cli, "make_proof", prove)
    if there:
        sample.write_proof(tmp_path / "data/proof")
    words = ["--no-accelerators", "--out", str(tmp_path), *arguments]
    assert cli.main(words) == 0
    assert asked == ([tmp_path / "data"] if made else [])
    assert (tmp_path / "proof.html").exists() == (there or made)


def test_interrupted_or_impossible_proof_leaves_the_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def harness(words: list[str]) -> int:
        write_results(tmp_path / "data", [rendered_scene("one", "pass")])
        return 0

    monkeypatch.setattr(cli.harness, "main", harness)
    for raised, expected in ((KeyboardInterrupt(), 130), (ReportError("no disk"), 2)):

        def prove(*_: Any, raised: BaseException = raised) -> int:
            raise raised

        monkeypatch.setattr(cli, "make_proof", prove)
        assert cli.main(["--no-accelerators", "--out", str(tmp_path)]) == expected
        assert "Title of one" in (tmp_path / "index.html").read_text()
        (tmp_path / "index.html").unlink()


@pytest.mark.parametrize(("measured", "status"), [(0.5, 0), (0.95, 1), (float("nan"), 1)])
def test_register_is_written_as_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: float, status: int
) -> None:
    """One entry that disagrees, agrees now, or is no number; no end of a band is null."""
    entry = ExpectedFailure(
        "one", "a share", lambda: measured, 0.5, (0.4, 0.6), (0.9, float("inf")), "why"
    )
    monkeypatch.setattr(register_command, "REGISTER", (entry,))
    path = tmp_path / "register.json"
    assert register_command.main(["--out", str(path)]) == status
    (found,) = read_register(path).entries
    assert (found.name, found.what, found.reason) == ("one", "a share", "why")
    assert (found.band, found.agreement) == ((0.4, 0.6), (0.9, None))
    assert found.measured == (measured if measured == measured else None)
    assert found.alarm == bool(status)


def test_quick_register_leaves_out_what_is_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fast = ExpectedFailure("fast", "", lambda: 1.0, 1.0, (1.0, 1.0), (0.0, 0.0), "")
    slow = ExpectedFailure("slow", "", lambda: 1 / 0, 1.0, (1, 1), (0, 0), "", slow=True)
    monkeypatch.setattr(register_command, "REGISTER", (fast, slow))
    path = tmp_path / "register.json"
    assert register_command.main(["--quick", "--out", str(path)]) == 0
    assert [entry.name for entry in read_register(path).entries] == ["fast"]
