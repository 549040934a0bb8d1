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
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from reports.errors import ReportError
from reports.soak.damage.process import LARGE, PICTURE, REFUSED, damaged
from reports.soak.record import Step

SECONDS = 10.0  # of processor time a file may take
WAITING = 120.0  # [s] a file may take on a clock: the machine may be busy
WARMING = 1800.0  # [s] until the process is ready: every kernel may have to be compiled
LOOK_EVERY = 0.25  # [s] while an answer is awaited
AT_A_TIME = 50  # cases of a step
KEPT = Path("reports/out/soak")


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
        self._said = b""  # read of its answers, and not yet looked at

    def __enter__(self) -> Reader:
        """Return itself; the process starts with the first question."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process and forget its files."""
        self.close()
        self._folder.cleanup()

    def answers(self, numbers: Sequence[int]) -> Iterator[Answer]:
        """Yield what the file of each number leads to; a process that dies is an answer.

        A file may be the first of all that asks for a kernel, and compiling takes seconds:
        what took too long is tried again, with kernels from the cache.
        """
        left = list(numbers)
        while left:
            for found in self._asked(tuple(left)):
                first = left.pop(0)
                yield found if found.seconds <= SECONDS else next(self._asked((first,)))
                if found.fault or found.seconds > SECONDS:
                    break  # the process that was asked for the others is gone

    def _asked(self, numbers: tuple[int, ...]) -> Iterator[Answer]:
        """Yield answers up to the first one that ends the process.

        All is asked at once: a process that waited for each question would wait for its
        turn on a busy machine each time, which took twice as long as the answers.
        """
        process = self._process or self._start()
        assert process.stdin is not None
        words = "".join(f"{number}\n" for number in numbers)
        with suppress(BrokenPipeError):
            process.stdin.write(words.encode())
            process.stdin.flush()
        before = _processor_seconds(process.pid)
        for number in numbers:
            line = self._line(SECONDS + before, WAITING)
            if line:
                which, *answer = json.loads(line)
                assert which == number, (which, number)
                found = Answer(*answer)
            else:
                found = self._died(before)
            if found.fault or found.seconds > SECONDS:
                self.close()  # the next file finds a process that nothing has harmed
            if found.seconds > SECONDS and not found.fault:
                found = found._replace(fault=f"{found.seconds:.0f} s of processor time")
            yield found
            if found.fault or found.seconds > SECONDS:
                return
            before += found.seconds

    def _died(self, before: float) -> Answer:
        """Return what is said of a process that gave no answer."""
        assert self._process is not None
        process = self._process
        took = _processor_seconds(process.pid) - before
        self.close()
        if took > SECONDS:
            what = f"more than {SECONDS:g} s"
            return Answer(what, what, took)
        status = process.returncode
        what = "hangs" if status == -9 else "the process died"
        return Answer(what, f"{what}: status {status}", took)

    def _start(self) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", "reports.soak.damage.process", self._folder.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us
        )
        self._process = process
        assert process.stderr is not None
        os.set_blocking(process.stderr.fileno(), False)
        if self._line(WARMING, WARMING) != "ready":
            process.kill()
            text = (process.stderr.read() or b"").decode(errors="replace")
            said = text.strip().splitlines()
            raise ReportError(f"damaged files: {said[-1] if said else 'no process'}")
        # nobody reads what libraries say of damaged files; a full pipe would hold them up
        process.stderr.close()
        return process

    def _line(self, until: float, waiting: float) -> str:
        """Return the next line, or "" if the process ends or takes too long.

        Parameters
        ----------
        until
            Seconds of its processor time, from its start.
        waiting
            Seconds on a clock, from now.
        """
        process = self._process
        assert process is not None and process.stdout is not None
        give_up = time.monotonic() + waiting
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._said:
                if selector.select(LOOK_EVERY):
                    more = os.read(process.stdout.fileno(), 1 << 16)
                    if not more:
                        return ""
                    self._said += more
                    continue
                late = time.monotonic() > give_up
                if late or _processor_seconds(process.pid) > until:
                    process.kill()
                    return ""
        line, _, self._said = self._said.partition(b"\n")
        return line.decode()

    def close(self) -> None:
        """End the process; the next question starts another."""
        self._said = b""
        if self._process is not None:
            self._process.kill()
            with suppress(BrokenPipeError), self._process:  # closes its pipes, and waits
                pass
            self._process = None


def damaged_file_steps(
    done: int, deadline: float, kept: Path = KEPT, at_a_time: int = AT_A_TIME
) -> Iterator[Step]:
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
            counts: dict[str, int] = {}
            faults, slowest = [], 0.0
            numbers = range(done, done + at_a_time)
            for number, found in zip(numbers, reader.answers(numbers), strict=True):
                sound, content = damaged(number)
                end = Path(sound.name).suffix
                for name in (f"files: {end}", found.outcome):
                    counts[name] = counts.get(name, 0) + 1
                slowest = max(slowest, found.seconds)
                if found.fault:
                    faults.append(f"case {number}, {sound.name}: {found.fault}")
                    kept.mkdir(parents=True, exist_ok=True)
                    (kept / f"{number}-{sound.name}").write_bytes(content)
            yield Step(at_a_time, counts, {"processor seconds": slowest}, tuple(faults))
            done += at_a_time


def _processor_seconds(pid: int) -> float:
    """Return what a process has used of the processor, or 0 where nobody can know."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


OUTCOMES = (REFUSED, PICTURE, LARGE)
