"""One picture made in one go, and again with everything that can happen to it at night.

All by the command line, in processes of their own: a render is killed, its checkpoint is
resumed on a local cluster, one of whose workers is killed too, and the two files are
compared byte by byte. Kills wait for what has been reached, not for a clock.
"""

from __future__ import annotations

import filecmp
import functools
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil

from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.trials.scene_files import scene_file

SCENE = "cornell-box"
COMPARED = "both files, byte by byte"
POLL = 0.02  # [s]
LONGEST = 900.0  # [s] of one step; a machine may be busy

Rendering = subprocess.Popen[str]


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield what came of each step, and its seconds.

    Raises
    ------
    ValueError
        If a step ends in another way than it should.
    """
    spp = bench.whole("spp", 2048)  # some five seconds on two cores
    row = functools.partial(Row, case=case)
    with tempfile.TemporaryDirectory(prefix="lightproof-") as name:
        at_once, piecewise = Path(name, "at-once.exr"), Path(name, "piecewise.exr")
        kept = Path(name, "night.checkpoint")
        keeping = ("--checkpoint", kept, "--every", 0.5)
        steps: dict[str, Callable[[], str]] = {
            "in one go, 2 threads": lambda: _ended(_start(at_once, spp)),
            "again, kill -9": lambda: _killed(_start(piecewise, spp, *keeping), kept),
            "resumed, 2 workers, one kill -9": lambda: _resumed(
                _start(piecewise, spp, *keeping, "--resume", "--cluster", "local:2"), kept
            ),
            COMPARED: lambda: _compared(at_once, piecewise),
        }
        for step, take in steps.items():
            bench.show(step)
            begin = time.monotonic()
            came = take()
            yield row(contender=step, quantity="what came of it", value=came)
            seconds = time.monotonic() - begin
            yield row(contender=step, quantity="time", unit="s", value=seconds)


def _start(output: Path, spp: int, *more: object) -> Rendering:
    words = [scene_file(SCENE), "--spp", spp, "--threads", 2, "-o", output, *more]
    return subprocess.Popen(
        [sys.executable, "-m", "renderer", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def _ended(rendering: Rendering, status: int = 0) -> str:
    """Return what a render printed, in its last line, when it ended with this status."""
    said, _ = rendering.communicate(timeout=LONGEST)
    last = (said.strip().splitlines() or ["it said nothing"])[-1]
    if rendering.returncode != status:
        raise ValueError(f"status {rendering.returncode}, not {status}: {last}")
    if status == 0 and (tally := re.search(r"cluster: (\d+ portion.*)", said)):
        return tally[1]
    return last.partition("; wrote")[0]


def _killed(rendering: Rendering, checkpoint: Path) -> str:
    _wait(rendering, checkpoint.exists)
    rendering.kill()
    _ended(rendering, -signal.SIGKILL)
    return f"no picture, a checkpoint of {checkpoint.stat().st_size / 1e6:.1f} MB"


def _resumed(rendering: Rendering, checkpoint: Path) -> str:
    before = checkpoint.stat().st_mtime_ns
    # a new checkpoint is written when the workers have added samples
    _wait(rendering, lambda: checkpoint.stat().st_mtime_ns != before)
    children = psutil.Process(rendering.pid).children(recursive=True)
    workers = [c for c in children if any("spawn_main" in word for word in c.cmdline())]
    workers[0].kill()
    came = _ended(rendering)
    if "lost" not in came:
        raise ValueError(f"no worker was missed: {came}")
    return came


def _wait(rendering: Rendering, reached: Callable[[], bool]) -> None:
    end = time.monotonic() + LONGEST
    while not reached():
        if rendering.poll() is not None:
            raise ValueError(f"too short to be killed, set more spp: {_ended(rendering)}")
        if time.monotonic() > end:
            rendering.kill()
            raise ValueError(f"a step took more than {LONGEST:.0f} s")
        time.sleep(POLL)


def _compared(first: Path, second: Path) -> str:
    if not filecmp.cmp(first, second, shallow=False):
        raise ValueError("the files differ")
    return f"the same {first.stat().st_size} bytes"


def verdict(table: Table) -> str:
    """Say whether both files are the same."""
    if table.faults or not table.where(contender=COMPARED):
        return ""
    return "A render that is killed and resumed on a cluster gives the same file."


STUDY = described(
    "resilience",
    cases=("killed and resumed",),
    measure=measure,
    verdict=verdict,
)
