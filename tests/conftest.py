"""What all tests share: failures printed at once, and the collector kept out.

Tests lie in rooms, as what they test does. What several of them use is in `probes`, which
is on the path, as this folder is: no test imports another (tests/project/test_rooms.py).

A run that something ends from outside (a hung process, CI's own limit) never comes to
pytest's closing summary; without this its output says that tests failed and not which.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

# no test is timed: on a busy machine an example took 425 ms of its 200
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")

# before anything imports NumPy: two workers' threads for products of matrices would wait
# for each other, at the price of as much time again
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


TESTS = Path(__file__).parent
# some tests of mitsuba_ref still import one another
ROOMS = sorted(path for path in (TESTS / "mitsuba_ref").iterdir() if path.is_dir())
sys.path[:0] = map(str, (TESTS, TESTS / "probes", *ROOMS))


class FailuresAtOnce:
    """Prints each failure below the progress line, in the process that reports."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self._terminal = terminal

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._terminal.ensure_newline()
            self._terminal.write_line(f"failed: {report.nodeid} ({report.when})")
            self._terminal.write_line(report.longreprtext)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Join the process that has a terminal: under xdist the controller, no worker."""
    plugins = session.config.pluginmanager
    terminal = plugins.get_plugin("terminalreporter")
    if terminal is not None and not hasattr(session.config, "workerinput"):
        plugins.register(FailuresAtOnce(terminal))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[Any]:
    """Keep Python's collector off what lives to the end: modules, and 8,000 tests.

    Each of its looks at everything took a quarter of a second, and together a 25th of the
    suite's time: whenever a kernel is compiled, many objects are made.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.fixture
def no_collection() -> Iterator[None]:
    """Keep Python's collector out: hypothesis hangs a callback on it.

    What is raised inside of one, such as an interrupt, is lost.
    """
    gc.disable()
    yield
    gc.enable()


@pytest.fixture
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def heeding_interrupts() -> Iterator[None]:
    """As from a terminal, where nohup or a shell's `&` started the tests too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
