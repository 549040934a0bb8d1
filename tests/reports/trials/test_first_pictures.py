"""Processes that start and compile: their caches, and what is no picture."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from reports.trials import first_pictures
from reports.trials.first_pictures import compile_seconds, start_seconds


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Commands that were started, each with whether its cache is empty; no picture is made.

    The cache of this process has a kernel.
    """
    (cache := tmp_path / "cache").mkdir()
    (cache / "kernel").touch()
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(cache))
    found: list[Any] = []

    def run(command: list[str], env: dict[str, str], **_: object) -> Any:
        found.append((command, not os.listdir(env["LIGHTPROOF_CACHE"])))
        if "late.xml" in command:
            raise subprocess.TimeoutExpired(command, 300.0)
        if "blank.xml" not in command:
            Path(command[command.index("-o") + 1]).touch()
        status = int("broken.xml" in command)
        return subprocess.CompletedProcess(command, status, "", "first\nit broke\n")

    monkeypatch.setattr(subprocess, "run", run)
    return found


def test_a_start_finds_the_cache_or_another(started: list[Any], tmp_path: Path) -> None:
    (other := tmp_path / "other").mkdir()
    assert start_seconds(Path("a.xml"), {"width": "8"}) > 0.0
    assert start_seconds(Path("a.xml"), {}, other) > 0.0
    assert [empty for _, empty in started] == [False, True]
    command = started[0][0]
    assert command[:7] == [sys.executable, "-m", "renderer", "a.xml", "--spp", "1", "-o"]
    assert command[8:] == ["-Dwidth=8"]


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ("broken.xml", "status 1: it broke"),
        ("blank.xml", "status 0: it broke"),
        ("late.xml", "no picture within 300 s"),
    ],
)
def test_start_without_a_picture_is_not_a_time(
    started: list[Any], scene: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        start_seconds(Path(scene), {})


def stand_in(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Let the process that compiles be this program, with the same arguments."""
    popen = subprocess.Popen

    def start(command: list[str], **options: Any) -> Any:
        return popen([sys.executable, "-c", program, *command[3:]], **options)

    monkeypatch.setattr(first_pictures.subprocess, "Popen", start)


def test_compile_times_are_of_one_process_whose_cache_is_empty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two scenes of a stand-in: each time as it says it, in order."""
    program = (
        "import json, os, sys\n"
        "cache = os.environ['LIGHTPROOF_CACHE']\n"
        "for n, scene in enumerate(sys.argv[1:]):\n"
        "    seconds = len(os.listdir(cache)) + 0.5\n"
        "    open(os.path.join(cache, scene), 'w').close()\n"
        "    print(json.dumps({'scene': scene, 'seconds': seconds}), flush=True)\n"
    )
    told: list[str] = []
    stand_in(monkeypatch, program)
    found = dict(compile_seconds(["metals", "mine"], told.append))
    assert found == {"metals": 0.5, "mine": 1.5}
    assert told == ["compiling: metals, 1 of 2", "compiling: mine, 2 of 2"]


def test_process_that_ends_early_is_no_compile_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stand_in(monkeypatch, "import sys\nsys.exit('it broke')")
    with pytest.raises(ValueError, match="metals: no picture: it broke"):
        list(compile_seconds(["metals"], lambda stage: None))


def test_first_picture_is_timed_in_processor_seconds(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The real program on one scene: a line of JSON with a time above 0."""
    first_pictures.main(["white-furnace"])
    line = json.loads(capsys.readouterr().out)
    assert line["scene"] == "white-furnace"
    assert line["seconds"] > 0.0
