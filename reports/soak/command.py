"""`python -m reports.soak`: long trials, each goes on where the record says it was."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import Show, shown_stages
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.machine import circumstances, describe_machine
from reports.errors import ReportError
from reports.records.measured import MEASURED
from reports.soak.page import soak_page
from reports.soak.record import FILE, Part, Session, Soak, read_soak, write_soak
from reports.soak.studies import STUDIES, Study

DEFAULT_OUT = Path("reports/out")
BUDGET = 3600.0  # [s] of each trial
WRITTEN_EVERY = 5.0  # [s]
FAULTY, WRONG_USE, INTERRUPTED = 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Soak, keep the record, draw soak.html; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    console, status = Console(stderr=True), 0
    try:
        soak = read_soak(given.record) if given.record.exists() else Soak()
        faults_before = soak.fault_count
        soak = replace(soak, **circumstances("reports.soak", words))
        try:
            with shown_stages() as show:
                for study in STUDIES:
                    if study.name in (given.only or [study.name]) and not given.draw:
                        soak = _soaked(soak, study, given, show)
        except KeyboardInterrupt:
            console.print("reports.soak: interrupted, what was done is in the record")
            status, soak = INTERRUPTED, _read_again(given.record, soak)
        page = given.out / "soak.html"
        write_atomically(page, soak_page(soak).encode())
    except ReportError as error:
        console.print(f"reports.soak: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    output = Console()
    for study in STUDIES:
        part = soak.parts.get(study.name, Part())
        faults = f"{part.fault_count} faults" if part.fault_count else "no fault"
        line = f"{study.title}: {part.done:,} {study.unit}, {faults}"
        output.print(line, markup=False, highlight=False, soft_wrap=True)
    output.print(f"The page: {page}", markup=False, soft_wrap=True)
    return status or (FAULTY if soak.fault_count > faults_before else 0)


def _soaked(soak: Soak, study: Study, given: argparse.Namespace, show: Show) -> Soak:
    """Run one trial for its budget, and write the record while it goes on."""
    part = soak.parts.get(study.name, Part())
    if study.complete(part):
        return soak
    cpu = str(soak.machine.get("cpu", "unknown"))
    part = part.begun(Session(soak.created, soak.commit, cpu))
    start = last = written = time.monotonic()
    steps = study.steps(part, start + given.budget)
    try:
        for step in steps:
            now = time.monotonic()
            part, last = part.after(step, now - last), now
            faults = f", {part.fault_count} faults" if part.fault_count else ""
            show(f"{study.title}: {part.done:,} of {study.wanted:,} {study.unit}{faults}")
            if now - written > WRITTEN_EVERY:
                write_soak(given.record, _with(soak, study, part))
                written = now
            if study.complete(part):
                break
    finally:
        steps.close()  # type: ignore[attr-defined]
        if part.sessions[-1].done:
            soak = _with(soak, study, part)
            write_soak(given.record, soak)
    return soak


def _with(soak: Soak, study: Study, part: Part) -> Soak:
    parts = {**soak.parts, study.name: part}
    return replace(soak, parts=parts, machine=describe_machine())  # busy so far, or not


def _read_again(record: Path, otherwise: Soak) -> Soak:
    return read_soak(record) if record.exists() else otherwise


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.soak",
        allow_abbrev=False,
        description="Look for what is rare: rays that leak or meet their own surface, "
        "damaged files that crash, interrupts that leave half a file, memory that grows. "
        "Each trial goes on where the record says it was; Ctrl-C keeps what was done.",
        epilog=f"Exit status: 0 no fault, {FAULTY} a fault was found, {WRONG_USE} the "
        f"command line or the record is wrong, {INTERRUPTED} interrupted.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    names = [study.name for study in STUDIES]
    add("--only", nargs="+", choices=names, metavar="NAME", help=", ".join(names))
    add("--budget", type=_seconds, default=BUDGET, metavar="SECONDS", help="of each trial")
    add(
        "--record",
        type=Path,
        default=MEASURED / FILE,
        metavar="FILE",
        help="is read, grows and is written",
    )
    add("--draw", action="store_true", help="draw the page of the record, and nothing else")
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value
