"""`python -m mitsuba_ref.expected_failures`: run the register, print and write it."""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mitsuba_ref.expected_failures.register import REGISTER, Band, Outcome, check
from mitsuba_ref.records import machine
from mitsuba_ref.records.results import write_atomically

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
        circumstances = {
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": shlex.join(
                ["python", "-m", "mitsuba_ref.expected_failures", *given]
            ),
            "machine": machine.describe_machine(),
            "versions": machine.installed_versions(),
            "commit": machine.current_commit(),
        }
        content = as_json(measured, circumstances)
        write_atomically(options.out, (content + "\n").encode())
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


def as_json(measured: Measured, circumstances: dict[str, Any]) -> str:
    """Return the text of register.json; a band without end has null there."""
    entries = [
        {
            "name": outcome.entry.name,
            "what": outcome.entry.what,
            "reason": outcome.entry.reason,
            "expected": outcome.entry.measured,
            "band": _ends(outcome.entry.band),
            "agreement": _ends(outcome.entry.agreement),
            "measured": outcome.measured if math.isfinite(outcome.measured) else None,
            "verdict": outcome.verdict,
            "seconds": round(seconds, 3),
        }
        for outcome, seconds in measured
    ]
    content = {"schema": SCHEMA, **circumstances, "entries": entries}
    return json.dumps(content, indent=1, allow_nan=False)


def _ends(band: Band) -> list[float | None]:
    return [end if math.isfinite(end) else None for end in band]


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
        description="Measure everything that is known to disagree. Exit status: 0 each "
        "entry still disagrees by its own number, 1 one agrees now or has another number.",
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="leave out the slow entries")
    add("--out", type=Path, metavar="FILE", help="write the outcomes there, as JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
