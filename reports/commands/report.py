"""The command `lightproof-report`: render, compare, measure, draw all pages."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command import cli as harness
from mitsuba_ref.records.verdicts import statuses_in_words
from reports.commands.pages import DEFAULT_OUT, INTERRUPTED, WRONG_USE, draw
from reports.errors import ReportError
from reports.proof_page.run import QUICK as QUICK_PROOF
from reports.proof_page.run import make_proof, results_file

DEFAULT_SIZE = "demo"
STOPPED = WRONG_USE, INTERRUPTED

EPILOG = f"""exit status, that of the most severe verdict:
{statuses_in_words()}
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare scenes and draw the page, or draw old results; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    parser = _parser()
    given = parser.parse_args(sys.argv[1:] if arguments is None else arguments)
    if given.source is not None and (
        given.scenes or given.size or given.ladder is not None or given.proof
    ):
        parser.error(
            "--from draws old results: no SCENE, --size, --ladder, --proof beside it"
        )
    status = 0
    source: Path = given.source or given.out / "data" / "results.json"
    if given.source is None:
        written_before = _written_at(source)
        status = _run_harness(given, source.parent)
        if status in STOPPED and _written_at(source) == written_before:
            return status  # nothing new to show
        if status not in STOPPED:
            try:
                _further_pages(given, source.parent)
            except KeyboardInterrupt:
                status = INTERRUPTED  # the scenes are there to look at
            except ReportError as error:
                status = _refused(error)
    try:
        shown = draw(source, given.out)
    except ReportError as error:
        return _refused(error)
    return status or shown


def _refused(error: ReportError) -> int:
    sentence = f"lightproof-report: {error}"
    Console(stderr=True).print(sentence, markup=False, soft_wrap=True)
    return WRONG_USE


def _further_pages(given: argparse.Namespace, data: Path) -> None:
    """Measure what is asked for, or due because all scenes were rendered."""
    if _wants(given.proof, results_file(data), given):
        make_proof(data, QUICK_PROOF)


def _wants(asked: bool | None, made: Path, given: argparse.Namespace) -> bool:
    """Say whether to measure: asked for, or all scenes and nothing made so far."""
    return asked if asked is not None else not (given.scenes or made.exists())


def _run_harness(given: argparse.Namespace, data: Path) -> int:
    """Let the harness render, compare and write results.json and pictures to `data`."""
    wanted = [str(scene) for scene in given.scenes]
    wanted += ["--report", str(data), "--size", given.size or DEFAULT_SIZE]
    # the page "proof" replays; here, its kernels would double what is compiled
    wanted += ["--checks", "statistics"]
    if given.ladder is not False:
        wanted.append("--ladder")
    return harness.main(wanted)


def _written_at(path: Path) -> int | None:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof-report",
        description="Render scenes in lightproof and in Mitsuba 3, compare them, and write "
        "one self-contained HTML page.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add(
        "scenes",
        nargs="*",
        type=Path,
        metavar="SCENE",
        help="scene.xml or its folder; default: all of scenes/",
    )
    add(
        "--out",
        type=Path,
        default=DEFAULT_OUT,
        metavar="DIR",
        help="where index.html goes (default: %(default)s)",
    )
    add(
        "--from",
        dest="source",
        type=Path,
        metavar="RESULTS.json",
        help="draw these results instead of rendering",
    )
    add(
        "--size",
        choices=("demo", "test"),
        help=f"which size of each scene's proof.toml (default: {DEFAULT_SIZE})",
    )
    add(
        "--ladder",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="measure speed against accuracy too (default: yes)",
    )
    add(
        "--proof",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="replay and test the scenes too (default: with all scenes, the first time)",
    )
    return parser
