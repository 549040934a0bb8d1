"""One picture made in one go, and again with everything that can happen to it at night.

All by the command line, in processes of their own: a render is killed, its checkpoint is
resumed on a local cluster, one of whose workers is killed too, and the two files are
compared byte by byte. Kills wait for what has been reached, not for a clock.
"""

from __future__ import annotations

import filecmp
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import psutil

from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.trials.contenders import scene_file

SCENE = "cornell-box"
WORKERS = 2
COMPARED = "both files, byte by byte"
POLL = 0.02  # [s]
LONGEST = 900.0  # [s] of one step; a machine may be busy


class Step(NamedTuple):
    """What was done, and what came of it."""

    what: str
    came: str
    good: bool
    seconds: float


class Command:
    """A render in a process of its own."""

    def __init__(self, output: Path, spp: int, *more: object) -> None:
        words = [scene_file(SCENE), "--spp", spp, "--threads", 2, "-o", output, *more]
        self.started = time.monotonic()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "renderer", *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def until(self, reached: Callable[[], bool]) -> bool:
        """Wait until something is reached; return false if the process ends before."""
        while not reached():
            if self.process.poll() is not None:
                return False
            if time.monotonic() - self.started > LONGEST:
                self.process.kill()
                raise TimeoutError(f"a step took more than {LONGEST:.0f} s")
            time.sleep(POLL)
        return True

    def end(self) -> tuple[int, str, float]:
        """Wait for the end; return status, what was printed, and the seconds."""
        said, _ = self.process.communicate(timeout=LONGEST)
        return self.process.returncode, said, time.monotonic() - self.started


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield what came of each step, up to the first that fails, and its seconds."""
    spp = bench.whole("spp", 2048)  # some five seconds on two cores
    with tempfile.TemporaryDirectory(prefix="lightproof-") as name:
        folder = Path(name)
        at_once, piecewise = folder / "at-once.exr", folder / "piecewise.exr"
        checkpoint = folder / "night.checkpoint"
        for doing, step in (
            ("in one go", lambda: _at_once(at_once, spp)),
            ("again, until kill -9", lambda: _killed(piecewise, spp, checkpoint)),
            ("resumed on a cluster", lambda: _resumed(piecewise, spp, checkpoint)),
            ("comparing", lambda: _compared(at_once, piecewise)),
        ):
            bench.show(doing)
            what, came, good, seconds = step()
            yield Row(case=case, contender=what, quantity="what came of it", value=came)
            yield Row(case=case, contender=what, quantity="time", unit="s", value=seconds)
            if not good:
                yield Row(case=case, contender=what, quantity="fault", value=came)
                return


def _at_once(output: Path, spp: int) -> Step:
    status, said, seconds = Command(output, spp).end()
    came = _last_line(said).partition("; wrote")[0]
    return Step("in one go, 2 threads", came, status == 0, seconds)


def _killed(output: Path, spp: int, checkpoint: Path) -> Step:
    command = Command(output, spp, "--checkpoint", checkpoint, "--every", 0.5)
    alive = command.until(checkpoint.exists)
    command.process.kill()
    status, said, seconds = command.end()
    good = alive and status == -signal.SIGKILL and not output.exists()
    came = f"it ended before it could be killed; try more --set spp: {_last_line(said)}"
    if alive:
        size = f"{checkpoint.stat().st_size / 1e6:.1f} MB"
        came = f"no picture, a checkpoint of {size}"
    return Step("again, kill -9", came, good, seconds)


def _resumed(output: Path, spp: int, checkpoint: Path) -> Step:
    before = checkpoint.stat().st_mtime_ns
    more = ("--checkpoint", checkpoint, "--every", 0.5, "--resume")
    command = Command(output, spp, *more, "--cluster", f"local:{WORKERS}")
    # a new checkpoint is written when the workers have added samples
    alive = command.until(lambda: checkpoint.stat().st_mtime_ns != before)
    workers = _workers(command.process.pid) if alive else []
    for worker in workers[:1]:
        os.kill(worker, signal.SIGKILL)
    status, said, seconds = command.end()
    tally = re.search(r"cluster: (\d+ portion.*)", said)
    lost = re.search(r"\d workers? lost", said)
    came = tally[1] if tally and status == 0 else _last_line(said)
    good = status == 0 and bool(workers) and lost is not None
    return Step(f"resumed, {WORKERS} workers, one kill -9", came, good, seconds)


def _compared(first: Path, second: Path) -> Step:
    same = filecmp.cmp(first, second, shallow=False)
    size = f"the same {first.stat().st_size} bytes"
    return Step(COMPARED, size if same else "the files differ", same, 0.0)


def _workers(pid: int) -> list[int]:
    """Return the process ids of a cluster's workers, each a spawned Python."""
    children = psutil.Process(pid).children(recursive=True)
    return [c.pid for c in children if any("spawn_main" in word for word in c.cmdline())]


def _last_line(said: str) -> str:
    return (said.strip().splitlines() or ["it said nothing"])[-1]


def verdict(table: Table) -> str:
    """Say whether both files are the same."""
    if table.faults or not table.where(contender=COMPARED):
        return ""
    return (
        "A render that is killed and resumed on a cluster gives the same file, bit for bit."
    )


STUDY = Study(
    title="The same picture after kill -9?",
    sentence="A render is killed and resumed on a cluster, of which a worker is killed. Is "
    "the file the same as that of a render in one go?",
    minutes=1,
    cases=("killed and resumed",),
    options={"spp": "samples per pixel (2048); more where a render ends too soon"},
    measure=measure,
    verdict=verdict,
)
