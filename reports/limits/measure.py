"""One row of the atlas measured: both sides of its boundary, the curve, the boundary."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

from mitsuba_ref.command.stages import Show
from mitsuba_ref.records.machine import circumstances
from reports.limits.record import AGREES, AS_SAID, BROKEN, EARLY, Limits, MeasuredRow
from reports.limits.row import Row, Sides, measure_sides
from reports.look.pictures import picture_uri

HALVINGS = 5  # of the place where a method gives way, on a logarithmic scale


def measure_atlas(rows: Iterable[Row], words: Sequence[str], show: Show) -> Limits:
    """Measure rows one after the other; what fails to be measured is a row with an error.

    Parameters
    ----------
    rows
        Of the atlas.
    words
        Arguments of the command, for the record.
    show
        Is told which row is next.
    """
    chosen = list(rows)
    measured = []
    for number, row in enumerate(chosen, 1):
        show(f"limits: {row.name}, {number} of {len(chosen)}")
        measured.append(measure_row(row))
    return Limits(rows=tuple(measured), **circumstances("reports.limits", words))


def measure_row(row: Row) -> MeasuredRow:
    """Return the row as it is today; no exception but an interrupt leaves."""
    started = time.perf_counter()
    # the two sides are mostly on the curve too, and a measurement gives the same each time
    row = replace(row, measure=functools.cache(row.measure))
    try:
        sides = measure_sides(row)
        curve = tuple((x, _finite(row.measure(x))) for x in row.strengths)
        found = verdict(sides, curve)
        holds_to, fails_from = _boundary(sides)
        picture = "" if row.picture is None else picture_uri(row.picture())
    except Exception as error:  # whatever it is: the others are measured all the same
        seconds = time.perf_counter() - started
        text = f"{type(error).__name__}: {error}"
        return MeasuredRow(row.name, BROKEN, error=text, seconds=seconds)
    return MeasuredRow(
        row.name,
        found,
        _finite(sides.before),
        None if sides.behind is None else _finite(sides.behind),
        curve,
        holds_to,
        fails_from,
        picture,
        seconds=time.perf_counter() - started,
    )


def verdict(sides: Sides, curve: Iterable[tuple[float, float | None]]) -> str:
    """Return what the two sides and the curve (strength, measured) say together."""
    row = sides.row
    last = math.inf if row.fails_at is None else row.holds_at
    behind = math.inf if row.fails_at is None else row.fails_at
    within = {x: y is not None and y <= row.tolerance for x, y in curve}
    if not sides.holds_before or not all(ok for x, ok in within.items() if x <= last):
        return EARLY
    if not sides.fails_behind or any(ok for x, ok in within.items() if x >= behind):
        return AGREES
    return AS_SAID


def _finite(value: float) -> float | None:
    """Return the number, a Python float, or None for what JSON cannot hold."""
    return float(value) if math.isfinite(value) else None


def _boundary(sides: Sides) -> tuple[float, float | None]:
    """Return (holds, fails): the place where the method gives way, halved some times."""
    row = sides.row
    low, high = row.holds_at, row.fails_at
    if (
        high is None
        or low <= 0.0
        or row.slow
        or not (sides.holds_before and sides.fails_behind)
    ):
        return low, high
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        if row.measure(middle) <= row.tolerance:
            low = middle
        else:
            high = middle
    return low, high
