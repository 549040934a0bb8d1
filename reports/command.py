"""The command `python -m reports`: measure studies, keep their rows, draw their pages."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.records.json_files import write_atomically
from reports.bench.rows import Table
from reports.bench.runner import Request, run_study
from reports.bench.store import Store
from reports.bench.study import Study, find_study, study_names
from reports.errors import ReportError
from reports.look.shared_files import write_shared_files
from reports.pages.history_page import history_page

FAULTY, WRONG_USE, INTERRUPTED = 1, 2, 130
DEFAULT_OUT = Path("reports/out")


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
        names = given.studies or study_names()
        studies = {name: find_study(name) for name in names}
        if given.keep:
            for name, study in studies.items():
                _say(store.keep(name, study.goes_on))
            return 0
        if not given.draw and not given.studies:
            raise ReportError(f"name a study, or --draw: {', '.join(names)}")
        faults: list[str] = []
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
            with shown_stages() as show:
                for name, study in studies.items():
                    try:
                        faults += run_study(name, study, request, show)
                    except KeyboardInterrupt:
                        console.print(f"{name}: interrupted, what ended is stored")
                        status = INTERRUPTED
                        break
        for name, study in studies.items():
            if page := draw(name, study, store, given.out):
                if sentence := study.verdict(_table(name, study, store)):
                    _say(f"{name}: {sentence}")
                _say(f"The page: {page}")
        write_shared_files(
            given.out, [(_file(n), find_study(n).title) for n in study_names()]
        )
        if given.draw and not given.studies:
            everything = {n: (s, store.everything(n)) for n, s in studies.items()}
            write_atomically(given.out / "history.html", history_page(everything).encode())
            _say(f"The page: {given.out / 'history.html'}")
    except ReportError as error:
        console.print(f"reports: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    for fault in faults:
        _say(fault)
    return status or (FAULTY if faults else 0)


def draw(name: str, study: Study, store: Store, out: Path) -> Path | None:
    """Draw the page of a study from its rows; return its path, or None without rows.

    Raises
    ------
    ReportError
        If the store cannot be read, or the rows not be drawn; an older page stays.
    """
    table = _table(name, study, store)
    if not table:
        return None
    page = out / _file(name)
    write_atomically(page, _page(study)(name, study, table).encode())
    return page


def _file(name: str) -> str:
    return f"{name.replace('-', '_')}.html"


def _table(name: str, study: Study, store: Store) -> Table:
    return store.everything(name) if study.goes_on else store.read(name)


def _page(study: Study) -> Callable[[str, Study, Table], str]:
    module, _, function = (study.page or "reports.pages.study_page:study_page").partition(
        ":"
    )
    found: Callable[[str, Study, Table], str] = getattr(
        importlib.import_module(module), function
    )
    return found


def _list() -> None:
    for name in study_names():
        study = find_study(name)
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
        epilog=f"Exit status: 0 no fault, {FAULTY} a fault was found, {WRONG_USE} the "
        f"command line or a file is wrong, {INTERRUPTED} interrupted: what ended is "
        "stored, and the same command goes on.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("studies", nargs="*", metavar="STUDY", help="see --list")
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
        help="of each case of a study without an end",
    )
    add(
        "--draw",
        action="store_true",
        help="draw the pages of what is stored; without STUDY also all over commits",
    )
    add("--keep", action="store_true", help="copy full measurements into the repository")
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="folder of the pages")
    return parser
