"""`python -m reports.proof`: replay and test every scene, draw the page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.request import FEWEST_SEEDS
from mitsuba_ref.records.verdicts import exit_status
from reports.argument_types import at_least
from reports.commands.pages import DEFAULT_OUT, INTERRUPTED, WRONG_USE, draw
from reports.errors import ReportError
from reports.proof_page.page import proof_page
from reports.proof_page.record import read_proof_record
from reports.proof_page.run import QUICK, ProofSettings, make_proof, results_file

EPILOG = """Exit status: that of the most severe verdict (python -m mitsuba_ref --help); 1
also for a hole in the matrix, an alarm of the register or too many false alarms, 2 the
command line or a file is wrong."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, and draw proof.html; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    parser = _parser()
    given = parser.parse_args(sys.argv[1:] if arguments is None else arguments)
    measures = given.quick or given.size or given.seeds or given.mutations
    if given.source is not None and (measures or given.false_alarms):
        parser.error("--from draws old records: nothing that measures beside it")
    console = Console(stderr=True)
    data, status = given.out / "data", 0
    source = given.source or results_file(data)
    try:
        if given.source is None:
            status = make_proof(data, _settings(given))
        shown = draw_proof(source, given.out)
    except KeyboardInterrupt:
        console.print("reports.proof: interrupted, the page stays as it was")
        return INTERRUPTED
    except ReportError as error:
        console.print(f"reports.proof: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    return status or shown


def draw_proof(source: Path, out: Path) -> int:
    """Draw proof.html in `out` from results; say where it is; return the exit status.

    Raises
    ------
    ReportError
        If the records cannot be shown; an older page stays as it is.
    """
    record = read_proof_record(source)
    content = proof_page(record, source.parent).encode()
    if (out / "data" / "results.json").exists():
        # With a link to this page. It draws the proof in `data` too, which may be another.
        draw(out / "data" / "results.json", out)
    write_atomically(out / "proof.html", content)
    Console().print(f"The proof: {out / 'proof.html'}", markup=False, soft_wrap=True)
    verdicts = [scene.verdict for scene in record.results.scenes]
    return exit_status(verdicts) or int(bool(record.faults))


def _settings(given: argparse.Namespace) -> ProofSettings:
    settings = QUICK if given.quick else ProofSettings()
    return replace(
        settings,
        size=given.size or settings.size,
        seeds=given.seeds or settings.seeds,
        mutations=given.mutations,
        false_alarms=given.false_alarms,
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.proof",
        description="Replay every scene with Mitsuba's random numbers, climb the ladder of "
        "tests with others, measure what is known to disagree, and draw the page.",
        epilog=EPILOG,
    )
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        default=DEFAULT_OUT,
        metavar="DIR",
        help="where proof.html goes (default: %(default)s)",
    )
    add(
        "--from",
        dest="source",
        type=Path,
        metavar="RESULTS.json",
        help="draw these results, and the other records beside them, instead of measuring",
    )
    add("--size", choices=("test", "demo"), help="of the pictures (default: demo)")
    add(
        "--seeds",
        type=at_least(FEWEST_SEEDS),
        metavar="K",
        help=f"pictures of each renderer, {FEWEST_SEEDS} or more (default: {FEWEST_SEEDS})",
    )
    add("--quick", action="store_true", help="test size, and nothing that takes long")
    add("--mutations", action="store_true", help="make the mutation matrix too (long)")
    add("--false-alarms", action="store_true", help="count the false alarms too (long)")
    return parser
