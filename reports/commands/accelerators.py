"""`python -m reports.accelerators`: measure every accelerator, draw the page."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.records.json_files import write_atomically
from reports.accelerator_page.page import accelerators_page
from reports.accelerator_study.record import read_accelerators
from reports.accelerator_study.settings import FULL, QUICK
from reports.accelerator_study.study import write_study
from reports.commands.pages import DEFAULT_OUT, INTERRUPTED, WRONG_USE, draw
from reports.errors import ReportError

FAULTY = 1
QUICK_HELP = (
    "few and small scenes, about a minute on two quiet cores, and about another one the "
    "first time, to compile (the default)"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, and draw accelerators.html; return the status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    target = given.out / "data" / "accelerators.json"
    console = Console(stderr=True)
    try:
        if given.source is None:
            command = shlex.join(["python", "-m", "reports.accelerators", *words])
            with shown_stages() as show:
                write_study(target, FULL if given.full else QUICK, command, show)
        else:
            read_accelerators(given.source)  # a damaged file must not replace a sound one
            write_atomically(target, given.source.read_bytes())
        record = read_accelerators(target)
        page = given.out / "accelerators.html"
        write_atomically(page, accelerators_page(record).encode())
        if (target.parent / "results.json").exists():
            draw(target.parent / "results.json", given.out)  # now with a link to this page
    except KeyboardInterrupt:
        console.print("reports.accelerators: interrupted, nothing was written")
        return INTERRUPTED
    except ReportError as error:
        console.print(f"reports.accelerators: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    Console().print(f"The accelerators: {page}", markup=False, soft_wrap=True)
    return FAULTY if record.faults else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.accelerators",
        allow_abbrev=False,
        description="Build, check, count and time every accelerator on the study scenes, "
        "with Embree beside them, and draw the page.",
        epilog=f"Exit status: 0, {FAULTY} a structure found wrong hits or was not built, "
        f"{WRONG_USE} the command line or the file is wrong.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    add("--from", dest="source", type=Path, metavar="ACCELERATORS.json", help="draw only")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help=QUICK_HELP)
    size.add_argument("--full", action="store_true", help="the sizes of the page's figures")
    return parser
