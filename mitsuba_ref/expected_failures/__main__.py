"""`python -m mitsuba_ref.expected_failures`: run the register, print and write it."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mitsuba_ref.expected_failures.register import REGISTER, Outcome, check
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_json

SCHEMA = 1
ALARM = 1

Measured = list[tuple[Outcome, float]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure every entry; return 0 if each still disagrees as it did, else 1."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    with Console(stderr=True).status("") as status:
        measured = measure(status.update, slow=not options.quick)
    output = Console() if sys.stdout.isatty() else Console(width=120)
    output.print(_table(measured))
    if options.out is not None:
        circumstances = machine.circumstances("mitsuba_ref.expected_failures", given)
        write_json(as_record(measured, circumstances), options.out)
        output.print(f"wrote {options.out}", markup=False, soft_wrap=True)
    return ALARM if any(outcome.alarm for outcome, _ in measured) else 0


def measure(tell: Callable[[str], None], *, slow: bool = True) -> Measured:
    """Return each outcome with its seconds; `tell` gets the name of each entry."""
    measured = []
    for entry in REGISTER:
        if slow or not entry.slow:
            tell(f"expected failures: {entry.name}")
            started = time.perf_counter()
            outcome = check(entry)
            measured.append((outcome, time.perf_counter() - started))
    return measured


def as_record(measured: Measured, circumstances: dict[str, Any]) -> dict[str, Any]:
    """Return the content of register.json; a band without end is infinite there."""
    entries = [
        {
            "name": outcome.entry.name,
            "what": outcome.entry.what,
            "reason": outcome.entry.reason,
            "expected": outcome.entry.measured,
            "band": outcome.entry.band,
            "agreement": outcome.entry.agreement,
            "measured": outcome.measured,
            "verdict": outcome.verdict,
            "seconds": round(seconds, 3),
        }
        for outcome, seconds in measured
    ]
    return {"schema": SCHEMA, **circumstances, "entries": entries}


def _table(measured: Measured) -> Table:
    table = Table(title="What is known to disagree", title_justify="left", box=SIMPLE_HEAD)
    for column in ("entry", "verdict"):
        table.add_column(column, overflow="fold")
    for column in ("today", "then", "band", "s"):
        table.add_column(column, justify="right", no_wrap=True)
    for outcome, seconds in measured:
        entry = outcome.entry
        table.add_row(
            entry.name,
            outcome.verdict,
            f"{outcome.measured:.4g}",
            f"{entry.measured:.4g}",
            f"{entry.band[0]:.4g} to {entry.band[1]:.4g}",
            f"{seconds:.1f}",
        )
    return table


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.expected_failures",
        allow_abbrev=False,
        description="Measure everything that is known to disagree. Exit status: 0 each "
        "entry still disagrees by its own number, 1 one agrees now or has another number.",
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="leave out the slow entries")
    add("--out", type=Path, metavar="FILE", help="write the outcomes there, as JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
