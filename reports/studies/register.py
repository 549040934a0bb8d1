"""What is known to disagree, measured anew: still so, and by the same number."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mitsuba_ref.expected_failures.register import REGISTER, Band, check
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.look.formatting import number

ENTRIES = {entry.name: entry for entry in REGISTER}


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Measure an entry of the register anew; yield it next to its expected number."""
    outcome = check(ENTRIES[case])
    entry = outcome.entry
    values: dict[str, float | str] = {
        "method and number": entry.what,
        "measured": outcome.measured,
        "expected": entry.measured,
        "band": _band(entry.band),
        "would agree at": _band(entry.agreement),
        "state": outcome.verdict,
        "reason": entry.reason,
    }
    for quantity, value in values.items():
        yield Row(case=case, quantity=quantity, value=value)
    if outcome.alarm:
        found = number(outcome.measured if math.isfinite(outcome.measured) else None, 4)
        sentence = f"{outcome.verdict}: {found} instead of {number(entry.measured, 4)}"
        yield Row(case=case, quantity="fault", value=sentence)


def _band(ends: Band) -> str:
    low, high = (number(end, 4) if math.isfinite(end) else "infinity" for end in ends)
    return f"{low} to {high}"


def verdict(table: Table) -> str:
    """Return how many known disagreements are still there."""
    states = [row.value for row in table.where(quantity="state")]
    still = states.count("still disagrees")
    return f"{still} of {len(states)} known disagreements are there as expected."


STUDY = described(
    "register",
    cases=tuple(ENTRIES),
    quick_cases=tuple(name for name, entry in ENTRIES.items() if not entry.slow),
    measure=measure,
    verdict=verdict,
)
