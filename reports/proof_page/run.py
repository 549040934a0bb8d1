"""Makes the records behind the page "proof": scenes, register, and on demand the rest."""

from __future__ import annotations

import subprocess
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mitsuba_ref.command import cli as harness
from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.records.request import FEWEST_SEEDS
from reports.errors import ReportError
from reports.proof_page.record import ALARMS, MATRIX, REGISTER

FOLDER = "proof"  # in the page's data
WRONG_USE, INTERRUPTED = 2, 130  # of the harness
QUICK_PAIRS = "20"
MOST_JOBS = 8  # that `mitsuba_ref.mutations` takes


@dataclass(frozen=True)
class ProofSettings:
    """How much to measure."""

    size: Literal["test", "demo"] = "demo"
    seeds: int = FEWEST_SEEDS  # pictures of each renderer for the ladder of tests
    causes: int = 8  # divergent pixels of a replay that are traced to the cause
    slow: bool = True  # all of the register, and all pairs of the false alarms
    mutations: bool = False
    false_alarms: bool = False


QUICK = ProofSettings(size="test", causes=2, slow=False)
"""A few minutes, most of them Mitsuba's."""


def results_file(data: Path) -> Path:
    """Return where the scenes' results are, for the folder `data` of a page."""
    return data / FOLDER / "results.json"


def make_proof(data: Path, settings: ProofSettings) -> int:
    """Replay and test all scenes, measure the register; return the harness's status.

    Parameters
    ----------
    data
        The page's folder for data; the mutation matrix and the false alarms go there, all
        else into its `proof`.
    settings
        How much to measure.

    Raises
    ------
    ReportError
        If a study cannot be made.
    KeyboardInterrupt
        If somebody stopped the harness, which then has written the scenes so far.
    """
    folder = results_file(data).parent
    words = ["--report", str(folder), "--size", settings.size]
    words += ["--seeds", str(settings.seeds), "--causes", str(settings.causes)]
    status = harness.main(words)
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    if status == WRONG_USE:
        raise ReportError("the scenes could not be compared, or their results not written")
    quick = [] if settings.slow else ["--quick"]
    _study("expected_failures", [*quick, "--out", str(folder / REGISTER)])
    if settings.mutations:
        jobs = str(min(usable_cores(), MOST_JOBS))
        _study("mutations", ["--jobs", jobs, "--out", str((data / MATRIX).parent)])
    if settings.false_alarms:
        pairs = [] if settings.slow else ["--pairs", QUICK_PAIRS]
        _study("false_alarms", [*pairs, "--out", str(data / ALARMS)])
    return status


def _study(module: str, arguments: list[str]) -> None:
    """Run a command of `mitsuba_ref` in a process of its own: Mitsuba runs in it."""
    command = [sys.executable, "-m", f"mitsuba_ref.{module}", *arguments]
    # on a terminal the study shows by itself what it does
    with nullcontext(str) if sys.stderr.isatty() else shown_stages() as show:
        show(f"python -m mitsuba_ref.{module}")
        status = subprocess.run(command).returncode
    if status not in (0, 1):  # 1: something is not as expected, and the file says what
        raise ReportError(f"python -m mitsuba_ref.{module} ended with status {status}")
