"""Damaged files of every format: each ends in a SceneError or a finite picture.

Within 10 s of processor time and 1 GiB. What is damaged follows from the case's number, so
that a fault is found again by it; the failing file is kept too.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from reports.bench.steps import Step
from reports.errors import ReportError
from reports.trials.soaking import reading_process
from reports.trials.soaking.reading_process import damaged

SECONDS = 10.0  # of processor time a file may take
WAITING = 120.0  # [s] a file may take on a clock: the machine may be busy
WARMING = 1800.0  # [s] until the process is ready: every kernel may have to be compiled
LOOK_EVERY = 0.25  # [s] while an answer is awaited
AT_A_TIME = 50  # cases of a step


class Answer(NamedTuple):
    """What a file led to."""

    outcome: str
    fault: str  # "" if there is none
    seconds: float  # of processor time


class Reader:
    """A process that reads files, and is replaced when one of them kills it."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Reader:
        """Return itself; the process starts with the first question."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process and remove its files."""
        self.close()
        self._folder.cleanup()

    def answer(self, number: int) -> Answer:
        """Return what the file of a number leads to; a process that dies is an answer.

        What took too long is tried again, with the kernels that had to be compiled first.
        """
        found = self._answer(number)
        return found if found.seconds < SECONDS else self._answer(number)

    def _answer(self, number: int) -> Answer:
        process = self._process or self._start()
        before = _processor_seconds(process.pid)
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.write(f"{number}\n".encode())
            process.stdin.flush()
        line = self._line(process, before + SECONDS, WAITING)
        if line:
            found = Answer(*json.loads(line))
        else:
            took = round(_processor_seconds(process.pid) - before, 2)  # whole ticks
            process.wait()
            outcome = "hangs" if process.returncode == -9 else "the process died"
            found = Answer(outcome, f"{outcome}: status {process.returncode}", took)
        if found.seconds >= SECONDS:
            what = f"more than {SECONDS:g} s"
            found = Answer(what, what, found.seconds)
        if found.fault:
            self.close()  # the next file finds a process that nothing has harmed
        return found

    def _start(self) -> subprocess.Popen[bytes]:
        process = self._process = subprocess.Popen(
            [sys.executable, "-m", reading_process.__name__, self._folder.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for this process alone
        )
        assert process.stderr is not None
        os.set_blocking(process.stderr.fileno(), False)
        if self._line(process, WARMING, WARMING) != "ready":
            process.kill()
            lines = (process.stderr.read() or b"").decode(errors="replace").split("\n")
            said = [line for line in lines if line.strip()]
            raise ReportError(f"damaged files: {said[-1] if said else 'no process'}")
        # what libraries say of damaged files is not read, and a full pipe would block them
        process.stderr.close()
        return process

    def _line(self, process: subprocess.Popen[bytes], until: float, waiting: float) -> str:
        """Return the next line, or "" if the process ends or takes too long.

        Parameters
        ----------
        process
            It is killed if it takes too long.
        until
            Seconds of its processor time, from its start.
        waiting
            Seconds on a clock, from now.
        """
        assert process.stdout is not None
        give_up, text = time.monotonic() + waiting, b""
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            while not text.endswith(b"\n"):
                late = time.monotonic() > give_up
                if selector.select(LOOK_EVERY):
                    more = os.read(process.stdout.fileno(), 1 << 16)
                    if not more:
                        return ""
                    text += more
                elif late or _processor_seconds(process.pid) > until:
                    process.kill()
                    return ""
        return text.decode().strip()

    def close(self) -> None:
        """End the process; the next question starts another."""
        if self._process is not None:
            self._process.kill()
            with suppress(BrokenPipeError), self._process:  # closes its pipes, and waits
                pass
            self._process = None


def damaged_file_steps(
    done: int, deadline: float, kept: Path, at_a_time: int = AT_A_TIME
) -> Generator[Step]:
    """Try case after case from number `done` on.

    Parameters
    ----------
    done, deadline
        The first case; when to stop, by `time.monotonic`.
    kept
        Folder for the files that made a fault.
    at_a_time
        Cases of a step.
    """
    with Reader() as reader:
        while time.monotonic() < deadline:
            counts: Counter[str] = Counter()
            faults, slowest = [], 0.0
            for number in range(done, done + at_a_time):
                sound, content = damaged(number)
                found = reader.answer(number)
                counts.update((f"files: {Path(sound.name).suffix}", found.outcome))
                slowest = max(slowest, found.seconds)
                if found.fault:
                    faults.append(f"case {number}, {sound.name}: {found.fault}")
                    kept.mkdir(parents=True, exist_ok=True)
                    (kept / f"{number}-{sound.name}").write_bytes(content)
            yield Step(at_a_time, counts, {"processor seconds": slowest}, tuple(faults))
            done += at_a_time


def _processor_seconds(pid: int) -> float:
    """Return what a process has used of the processor, or 0 where that is not known."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
