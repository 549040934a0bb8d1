"""`python -m reports` runs the harness, then draws what the harness wrote, and no more."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from report_samples import scene, write_results

from reports.commands import report as cli

Harness = Callable[[list[str]], int]


def harness_that(
    status: int, verdict: str | None, calls: list[list[str]] | None = None
) -> Harness:
    """A harness that writes one scene (none without a verdict) and ends with `status`."""

    def run(arguments: list[str]) -> int:
        if calls is not None:
            calls.append(arguments)
        if verdict is not None:
            report = Path(arguments[arguments.index("--report") + 1])
            write_results(report, [scene("one", verdict)])
        return status

    return run


@pytest.fixture(autouse=True)
def no_further_studies(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take minutes; what they have to do with this command is tested beside them."""
    monkeypatch.setattr(cli, "make_proof", lambda *_: 0)


def test_arguments_are_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(cli.harness, "main", harness_that(0, "pass", calls))
    assert cli.main(["--out", str(tmp_path), "scenes/a", "--size", "test"]) == 0
    assert cli.main(["--out", str(tmp_path), "--no-ladder"]) == 0
    data = str(tmp_path / "data")
    noisy = ["--checks", "statistics"]
    assert calls == [
        ["scenes/a", "--report", data, "--size", "test", *noisy, "--ladder"],
        ["--report", data, "--size", "demo", *noisy],
    ]


@pytest.mark.parametrize(
    "beside",
    [["scenes/a"], ["--size", "demo"], ["--ladder"], ["--no-ladder"], ["--proof"]],
    ids=" ".join,
)
def test_from_takes_nothing_that_only_a_render_could_obey(
    capsys: pytest.CaptureFixture[str], beside: list[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(["--from", "results.json", *beside])
    assert stopped.value.code == 2
    assert "--from draws old results" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("status", "verdict", "expected"),
    [(0, "pass", 0), (1, "fail", 1), (1, "error", 1), (130, "pass", 130)],
)
def test_page_is_drawn_whatever_the_scenes_say(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    status: int,
    verdict: str,
    expected: int,
) -> None:
    """A failing scene, and Ctrl-C after the first one, still leave a page to look at."""
    monkeypatch.setattr(cli.harness, "main", harness_that(status, verdict))
    assert cli.main(["--out", str(tmp_path)]) == expected
    assert "Title of one" in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("status", [2, 130])
def test_old_results_are_not_shown_as_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    """The harness stopped before it wrote anything: yesterday's page is not drawn anew."""
    write_results(tmp_path / "data", [scene("yesterday", "pass")])
    monkeypatch.setattr(cli.harness, "main", harness_that(status, None))
    assert cli.main(["--out", str(tmp_path)]) == status
    assert not (tmp_path / "index.html").exists()


def test_page_cannot_be_greener_than_the_harness(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Status 1 of the harness stays 1 even if every scene in the file passes."""
    monkeypatch.setattr(cli.harness, "main", harness_that(1, "pass"))
    assert cli.main(["--out", str(tmp_path)]) == 1


def test_unknown_option_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(["--speed", "9"])
    assert stopped.value.code == 2
    assert "--speed" in capsys.readouterr().err
