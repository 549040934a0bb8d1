"""Where methods fail: every case of the atlas, measured on both sides of its boundaries."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator

from reports.atlas import Case, every_case
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.studies.limits import (
    arithmetic,
    comparing,
    curves,
    intersections,
    lamps,
    media,
    offsets,
    paths,
    structures,
)

CHAPTERS = (
    arithmetic,
    comparing,
    curves,
    intersections,
    lamps,
    media,
    offsets,
    paths,
    structures,
)
MEASURES = {k: v for chapter in CHAPTERS for k, v in chapter.MEASURES.items()}
PICTURES = {k: v for chapter in CHAPTERS for k, v in chapter.PICTURES.items()}
HALVINGS = 5  # of the place where a method gives way, on a logarithmic scale


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the curve of each method of a case, its boundary, its faults; a picture."""
    chosen = every_case()[case]
    for name in chosen.methods:
        bench.show(name)
        yield from measure_method(chosen, name, MEASURES[name])
    if case in PICTURES:
        bench.show("picture")
        yield bench.picture(case, "failure", PICTURES[case]())


def measure_method(
    case: Case, name: str, measured: Callable[[float], float]
) -> Iterator[Row]:
    """Yield what is measured of one method.

    Yields
    ------
    Row
        "before" and "behind": at the strengths up to which the atlas says that the method
        holds, and from which on it fails. "curve": at each strength of the case.
        "boundary": where the method gives way; it holds at one end of the interval, and
        fails at the other. "fault": a strength at which it is not as the atlas says.
    """
    at_strength = functools.cache(measured)  # both sides are mostly on the curve too
    tolerance, method = case.tolerance_of(name), case.methods[name]

    def within(strength: float) -> bool:
        return at_strength(strength) <= tolerance  # not a number: it fails

    def row(quantity: str, strength: float) -> Row:
        value = at_strength(strength)
        return Row(
            case=case.name, contender=name, quantity=quantity, value=value, at=strength
        )

    low, high = case.holds(name), method.fails
    yield row("before", low)
    if high is not None:
        yield row("behind", high)
    yield from (row("curve", strength) for strength in case.strengths)
    faulty = False
    for strength in sorted({*case.strengths, low, low if high is None else high}):
        expected = case.expected(name, strength)
        if expected is not None and within(strength) != expected:
            faulty = True
            says = "holds" if expected else "fails"
            yield Row(
                case=case.name,
                contender=name,
                quantity="fault",
                value=f"{name} {says} at {strength:g} by the atlas; "
                f"measured: {at_strength(strength):.3g}, tolerance {tolerance:g}",
            )
    if high is not None and not faulty:
        ends = _halved(low, high, within, 0 if case.slow else HALVINGS)
        middle = math.sqrt(ends[0] * ends[1])
        yield Row(
            case=case.name,
            contender=name,
            quantity="boundary",
            value=middle,
            interval=(min(ends), max(ends)),
        )


def _halved(
    holds: float, fails: float, within: Callable[[float], bool], times: int
) -> tuple[float, float]:
    """Return a strength at which a method holds and one at which it fails, near by."""
    for _ in range(times if holds > 0.0 else 0):
        middle = math.sqrt(holds * fails)
        holds, fails = (middle, fails) if within(middle) else (holds, middle)
    return holds, fails


def _verdict(table: Table) -> str:
    return "" if table.faults else "No method failed outside of its known limits."


STUDY = Study(
    title="Where methods fail",
    sentence="Under which stress does each method give way, why, and what to do instead?",
    minutes=8,
    quick_minutes=4,
    cases=tuple(every_case()),
    quick_cases=[name for name, case in every_case().items() if not case.slow],
    axis="strength of the stress",
    headlines=("faults",),
    verdict=_verdict,
    page="reports.pages.limits_page:limits_page",
    measure=measure,
)
