"""What a long command says while it works, where there is no terminal."""

from __future__ import annotations

import io
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from mitsuba_ref.command.stages import StageLines, shown_stages

ROOT = Path(__file__).parents[2]


class Clock:
    """Seconds that pass when the test says so."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_first_stage_is_written_at_once(clock: Clock) -> None:
    stream = io.StringIO()
    StageLines(stream, clock)("loading")
    assert stream.getvalue() == "[    0 s] loading\n"


def test_many_short_stages_are_a_line_every_two_seconds(clock: Clock) -> None:
    """A hundred stages in ten seconds: five lines after the first, not a hundred."""
    stream = io.StringIO()
    lines = StageLines(stream, clock)
    for step in range(101):
        clock.now = 100.0 + step / 10
        lines(f"step {step}")
    said = stream.getvalue().splitlines()
    assert said == [f"[{2 * n:5d} s] step {20 * n}" for n in range(6)]


def test_long_stage_is_said_again_within_ten_seconds(clock: Clock) -> None:
    """Looked at every second for a minute, it leaves no ten seconds without a line."""
    stream = io.StringIO()
    lines = StageLines(stream, clock)
    lines("rendering")
    for second in range(1, 61):
        clock.now = 100.0 + second
        lines.remind()
    seconds = [int(line[1:6]) for line in stream.getvalue().splitlines()]
    assert max(b - a for a, b in zip(seconds, [*seconds[1:], 60], strict=True)) < 10


def test_stage_that_came_too_soon_is_what_is_said_next(clock: Clock) -> None:
    stream = io.StringIO()
    lines = StageLines(stream, clock)
    lines("first")
    clock.now += 0.5
    lines("second")
    clock.now += 9.0
    lines.remind()
    assert stream.getvalue().splitlines()[1].endswith("second")


def test_nothing_is_said_before_there_is_a_stage(clock: Clock) -> None:
    stream = io.StringIO()
    lines = StageLines(stream, clock)
    clock.now += 60.0
    lines.remind()
    assert stream.getvalue() == ""


def test_block_is_watched_while_it_works_and_not_after(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The watcher looks by itself, in a thread that ends with the block."""
    looked = threading.Event()
    monkeypatch.setattr(StageLines, "remind", lambda self: looked.set())
    stream = io.StringIO()
    before = threading.active_count()
    with shown_stages(stream, look_every=0.001) as show:
        show("working")
        assert stream.getvalue().endswith("working\n")
        assert looked.wait(timeout=60)
    assert threading.active_count() == before


def test_terminal_gets_no_lines() -> None:
    """A spinner takes their place, on one line, and is gone in the end."""

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    with shown_stages(stream) as show:
        show("working")
    assert "s] working" not in stream.getvalue()


def test_commands_say_something_before_their_imports() -> None:
    """The imports take seconds: nothing that is slow to import comes before the line."""
    program = (
        "import sys\n"
        "import reports.starting\n"
        "import reports.__main__\n"
        "heavy = {'numpy', 'numba', 'rich', 'msgspec', 'jinja2', 'plotly'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
        "sys.argv[1:] = ['--no-such-option']\n"
        "reports.__main__.main()\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True
    )
    first, *others = run.stderr.splitlines()
    assert first == "starting", run.stderr
    assert any("--no-such-option" in line for line in others)
