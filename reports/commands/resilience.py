"""One picture made in one go, and again with everything that can happen to it at night.

All by the command line, in processes of their own: a render is killed, its checkpoint is
resumed on a local cluster, one of whose workers is killed too, and the two files are
compared byte by byte. Kills wait for what has been reached, not for a clock.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import psutil
from rich.console import Console
from rich.table import Table

SCENE = Path(__file__).parents[2] / "scenes" / "cornell-box" / "scene.xml"
SPP = 2048  # some five seconds on two cores
WORKERS = 2
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
        words = [SCENE, "--spp", spp, "--threads", 2, "-o", output, *more]
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


def main(arguments: list[str] | None = None) -> int:
    """Print what happens, then a table; return 0 if the files are the same."""
    parser = argparse.ArgumentParser(
        prog="python -m reports.resilience", description=__doc__
    )
    parser.add_argument(
        "--spp", type=int, default=SPP, help="samples (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    console = Console(highlight=False)
    console.print(
        f"Renders {SCENE.parent.name} twice, {options.spp} samples per pixel: in one go, "
        "and killed, resumed on a cluster, a worker killed. About a minute."
    )
    with tempfile.TemporaryDirectory(prefix="lightproof-") as folder:
        steps = _steps(Path(folder), options.spp, console)
    table = Table("step", "what came of it", "seconds", "", title="The same picture?")
    for step in steps:
        mark = "[green]ok" if step.good else "[red]no"
        table.add_row(step.what, step.came, f"{step.seconds:.1f}", mark)
    console.print(table)
    return 0 if all(step.good for step in steps) else 1


def _steps(folder: Path, spp: int, console: Console) -> list[Step]:
    """Do one step after the other, up to the first that fails."""
    at_once, piecewise = folder / "at-once.exr", folder / "piecewise.exr"
    checkpoint = folder / "night.checkpoint"
    steps: list[Step] = []
    for doing, do in (
        ("rendering in one go ...", lambda: _at_once(at_once, spp)),
        ("rendering again, until kill -9 ...", lambda: _killed(piecewise, spp, checkpoint)),
        (
            f"resuming on {WORKERS} worker processes, of which one is killed ...",
            lambda: _resumed(piecewise, spp, checkpoint),
        ),
        ("comparing ...", lambda: _compared(at_once, piecewise)),
    ):
        console.print(doing)
        steps.append(do())
        if not steps[-1].good:
            break
    return steps


def _at_once(output: Path, spp: int) -> Step:
    status, said, seconds = Command(output, spp).end()
    came = _last_line(said).partition("; wrote")[0]
    return Step("one go, 2 threads", came, status == 0, seconds)


def _killed(output: Path, spp: int, checkpoint: Path) -> Step:
    command = Command(output, spp, "--checkpoint", checkpoint, "--every", 0.5)
    alive = command.until(checkpoint.exists)
    command.process.kill()
    status, said, seconds = command.end()
    good = alive and status == -signal.SIGKILL and not output.exists()
    came = f"no picture, a checkpoint of {_megabytes(checkpoint)}"
    if not alive:
        came = f"it ended before it could be killed; try more --spp: {_last_line(said)}"
    return Step("again, kill -9", came, good, seconds)


def _resumed(output: Path, spp: int, checkpoint: Path) -> Step:
    before = checkpoint.stat().st_mtime_ns
    more = ("--checkpoint", checkpoint, "--every", 0.5, "--resume")
    command = Command(output, spp, *more, "--cluster", f"local:{WORKERS}")
    # a new checkpoint is written when the workers have added samples
    alive = command.until(lambda: checkpoint.stat().st_mtime_ns != before)
    workers = [] if not alive else _workers(command.process.pid)
    for worker in workers[:1]:
        os.kill(worker, signal.SIGKILL)
    status, said, seconds = command.end()
    tally = re.search(r"cluster: (\d+ portion.*)", said)
    good = (
        status == 0 and bool(workers) and re.search(r"\d workers? lost", said) is not None
    )
    came = tally[1] if tally and status == 0 else _last_line(said)
    return Step(f"resumed, {WORKERS} workers, one kill -9", came, good, seconds)


def _compared(first: Path, second: Path) -> Step:
    same = filecmp.cmp(first, second, shallow=False)
    size = f"{first.stat().st_size} bytes"
    return Step("cmp", f"the same {size}" if same else "the files differ", same, 0.0)


def _workers(pid: int) -> list[int]:
    """Return the process ids of a cluster's workers, each a spawned Python."""
    children = psutil.Process(pid).children(recursive=True)
    return [c.pid for c in children if any("spawn_main" in word for word in c.cmdline())]


def _last_line(said: str) -> str:
    return (said.strip().splitlines() or ["it said nothing"])[-1]


def _megabytes(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB" if path.exists() else "none"
