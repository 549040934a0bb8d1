"""`python -m reports.history`: draw how records changed over commits, or keep new ones."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.records.json_files import write_atomically
from reports.errors import ReportError
from reports.history.kept import PARTIAL, keep
from reports.history.page import history_page
from reports.history.versions import clone_of, versions_of
from reports.records.measured import MEASURED

DEFAULT_OUT = Path("reports/out")
WRONG_USE, INTERRUPTED = 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw history.html, or copy whole records to reports/measured; return the status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    given = _parser().parse_args(sys.argv[1:] if arguments is None else arguments)
    console, output = Console(stderr=True), Console()
    try:
        if given.keep:
            lines = list(keep(given.out / "data"))
            for line in lines or [f"{given.out / 'data'}: there is no record"]:
                output.print(line, markup=False, soft_wrap=True)
            return 0
        clone_of(MEASURED.parent)
        found = {name: versions_of(MEASURED / name) for name in PARTIAL}
        page = given.out / "history.html"
        write_atomically(page, history_page(found).encode())
    except KeyboardInterrupt:
        console.print("reports.history: interrupted, nothing was written")
        return INTERRUPTED
    except ReportError as error:
        console.print(f"reports.history: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    output.print(f"The history: {page}", markup=False, soft_wrap=True)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.history",
        description="Draw how the records in reports/measured changed over commits, from "
        "git; with --keep copy there what was measured whole since.",
        epilog=f"Exit status: 0, {WRONG_USE} this is no git clone or a file is no record.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("--keep", action="store_true", help="copy whole records of --out, draw nothing")
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="folder of the pages")
    return parser
