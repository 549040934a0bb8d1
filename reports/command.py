"""The command `python -m reports`: measure studies, keep their rows, draw their pages."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.verdicts import exit_status, statuses_in_words
from reports.bench.rows import Table
from reports.bench.runner import Request, cases_of, run_study
from reports.bench.store import Store
from reports.bench.study import Study, available_studies, find_study, page_file
from reports.errors import ReportError
from reports.look.shared_files import write_shared_files
from reports.pages.history_page import history_page

FAULTY, WRONG_USE, INTERRUPTED = 1, 2, 130
DEFAULT_OUT = Path("reports/out")
ALL = "all"
DEFAULT_STUDY = "scenes"
INDEX, HISTORY = "index.html", "history.html"
EPILOG = f"""exit status, that of the most severe verdict of a scene:
{statuses_in_words()}
{FAULTY} also for a fault that a study found. After {INTERRUPTED} all cases that ended are
stored, and the same command goes on.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure studies and draw their pages; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    console = Console(stderr=True)
    store = Store(given.out / "data")
    status = 0
    try:
        if given.list:
            _list()
            return 0
        everything = given.studies == [ALL] or (
            not given.studies and (given.keep or given.draw)
        )
        names = given.studies or [DEFAULT_STUDY]
        studies = available_studies() if everything else {n: find_study(n) for n in names}
        if given.keep:
            for name, study in studies.items():
                _say(store.keep(name, study.goes_on))
            return 0
        faults: list[str] = []
        for study in studies.values():  # before the first is measured
            study.chosen(given.case or (), given.quick)
        if not given.draw:
            request = Request(
                store,
                words,
                given.quick,
                given.again,
                given.case or (),
                given.budget,
                _options(given.set or ()),
                given.out,
            )
            for name, study in studies.items():
                cases_of(name, study, request)  # wrong words are told before a long run
            with shown_stages() as show:
                for name, study in studies.items():
                    try:
                        faults += run_study(name, study, request, show)
                    except KeyboardInterrupt:
                        console.print(f"{name}: interrupted, what ended is stored")
                        status = INTERRUPTED
                        break
                    except ReportError as error:
                        if len(studies) == 1:
                            raise
                        # the other studies are measured
                        console.print(f"{name}: {error}", markup=False, soft_wrap=True)
                        status = WRONG_USE
        for name, study in studies.items():
            draw(name, study, store, given.out)
            table = table_of(name, study, store)
            if table and (sentence := study.verdict(table)):
                _say(f"{name}: {sentence}")
        if everything:
            rows = {n: (s, store.everything(n)) for n, s in studies.items()}
            write_atomically(given.out / HISTORY, history_page(rows).encode())
        _say(f"The page: {draw_index(store, given.out)}")
        status = status or _status(studies, store, given.case)
    except ReportError as error:
        console.print(f"reports: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    for fault in faults:
        _say(fault)
    return status or (FAULTY if faults else 0)


def table_of(name: str, study: Study, store: Store) -> Table:
    """Return the rows that a study's page is drawn from."""
    return store.everything(name) if study.goes_on else store.read(name)


def draw(name: str, study: Study, store: Store, out: Path) -> Path | None:
    """Draw the pages of a study from its rows; return the first, or None without rows.

    Raises
    ------
    ReportError
        If the store cannot be read, or the rows not be drawn; older pages stay.
    """
    table = table_of(name, study, store)
    if not table:
        return None
    if study.pages:
        pages: Mapping[str, str] = _function(study.pages)(name, study, table, out)
    else:
        page = study.page or "reports.pages.study_page:study_page"
        pages = {page_file(name): _function(page)(name, study, table)}
    for file, content in pages.items():
        write_atomically(out / file, content.encode())
    return next((out / file for file in pages), None)


def draw_index(store: Store, out: Path) -> Path:
    """Draw the page of all pages, and the files that all pages load; return its path."""
    studies = available_studies()
    tables = {
        name: (study, table_of(name, study, store)) for name, study in studies.items()
    }
    for name, study in studies.items():
        if name != DEFAULT_STUDY and not (out / page_file(name)).exists():
            draw(name, study, store, out)  # of rows that the repository keeps
    content: str = _function("reports.pages.index_page:index_page")(tables, out)
    write_atomically(out / INDEX, content.encode())
    # short titles, for the bar of all pages
    titles = [
        (page_file(name), study.title.partition(":")[0]) for name, study in studies.items()
    ]
    write_shared_files(out, [*titles, (HISTORY, "Over commits")])
    return out / INDEX


def _status(studies: Iterable[str], store: Store, cases: Sequence[str] | None) -> int:
    """Return the status of the most severe verdict among scenes; 0 without any.

    Of each scene the last verdict counts, also of a quick run.
    """
    verdicts = {
        (name, row.case): row.value
        for name in studies
        for row in store.everything(name).where(quantity="verdict")
        if not cases or row.case in cases
    }
    return exit_status(verdicts.values()) if verdicts else 0  # type: ignore[arg-type]


def _function(place: str) -> Any:
    module, _, function = place.partition(":")
    return getattr(importlib.import_module(module), function)


def _list() -> None:
    for name, study in available_studies().items():
        _say(f"{name:20} {study.sentence} ({study.minutes:g} min)")


def _say(line: str) -> None:
    Console().print(line, markup=False, soft_wrap=True, highlight=False)


def _options(words: Sequence[str]) -> dict[str, str]:
    options = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise ReportError(f"--set {word}: expected NAME=VALUE")
        options[name] = value
    return options


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports",
        allow_abbrev=False,
        description="Measure studies case by case, store the rows, draw the pages.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add(
        "studies",
        nargs="*",
        metavar="STUDY",
        help=f"see --list; {ALL}: every study; default: {DEFAULT_STUDY}",
    )
    add("--list", action="store_true", help="list the studies, with their minutes")
    add("--quick", action="store_true", help="a shorter measurement with larger intervals")
    add("--case", action="append", metavar="NAME", help="measure this case (repeatable)")
    add("--again", action="store_true", help="measure also what this commit has measured")
    add(
        "--set",
        action="append",
        metavar="NAME=VALUE",
        help="an option of the study (repeatable)",
    )
    add(
        "--budget",
        type=float,
        default=3600.0,
        metavar="SECONDS",
        help="of each case of a study without an end (default: 3600)",
    )
    add(
        "--draw",
        action="store_true",
        help="draw the pages of what is stored; without STUDY all of them",
    )
    add("--keep", action="store_true", help="copy full measurements into the repository")
    add(
        "--out",
        type=Path,
        default=DEFAULT_OUT,
        metavar="DIR",
        help=f"folder of the pages (default: {DEFAULT_OUT})",
    )
    return parser
