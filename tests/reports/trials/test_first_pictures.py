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


class Processes:
    """Stands for `subprocess.run`: notes each call and writes the picture it names."""

    def __init__(self, status: int = 0, writes: bool = True) -> None:
        self.status, self.writes = status, writes
        self.commands: list[list[str]] = []
        self.caches: list[str | None] = []
        self.cache_was_empty: list[bool] = []

    def __call__(
        self, command: list[str], *, env: dict[str, str], **_: object
    ) -> subprocess.CompletedProcess[str]:
        self.commands.append(command)
        self.caches.append(env.get("LIGHTPROOF_CACHE"))
        self.cache_was_empty.append(not os.listdir(env["LIGHTPROOF_CACHE"]))
        if self.writes:
            Path(command[command.index("-o") + 1]).touch()
        return subprocess.CompletedProcess(command, self.status, "", "first\nit broke\n")


@pytest.fixture
def warm_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    folder = tmp_path / "cache"
    folder.mkdir()
    (folder / "kernel").touch()
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(folder))
    return str(folder)


def test_a_start_finds_the_cache_or_another(
    warm_cache: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Processes()
    monkeypatch.setattr(subprocess, "run", run)
    assert start_seconds(Path("a.xml"), {"width": "8"}) > 0.0
    (other := tmp_path / "other").mkdir()
    assert start_seconds(Path("a.xml"), {}, other) > 0.0
    assert run.caches == [warm_cache, str(other)]
    assert run.cache_was_empty == [False, True]
    begin = [sys.executable, "-m", "renderer", "a.xml", "--spp", "1", "-o"]
    assert run.commands[0][:7] == begin
    assert run.commands[0][8:] == ["-Dwidth=8"]


@pytest.mark.parametrize(("status", "writes"), [(1, True), (0, False)])
def test_start_without_a_picture_is_not_a_time(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch, status: int, writes: bool
) -> None:
    monkeypatch.setattr(subprocess, "run", Processes(status, writes))
    with pytest.raises(ValueError, match=f"status {status}: it broke"):
        start_seconds(Path("a.xml"), {})


def test_start_that_takes_too_long_is_not_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def endless(command: list[str], **options: object) -> None:
        raise subprocess.TimeoutExpired(command, 300.0)

    monkeypatch.setattr(subprocess, "run", endless)
    with pytest.raises(ValueError, match="no picture within 300 s"):
        start_seconds(Path("a.xml"), {})


def stand_in(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Let the process that compiles be this program, with the same arguments."""
    popen = subprocess.Popen

    def start(command: list[str], **options: Any) -> Any:
        return popen([sys.executable, "-c", program, *command[3:]], **options)

    monkeypatch.setattr(first_pictures.subprocess, "Popen", start)


def test_compile_times_are_of_one_process_whose_cache_is_empty(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
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
    assert os.listdir(warm_cache) == ["kernel"]


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
