"""Measures studies case by case; what is done stays when the command is stopped."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from uuid import uuid4

from mitsuba_ref.command.stages import Show
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.other_programs import BusyClock
from reports.bench.rows import Done, Row, Run
from reports.bench.store import Line, Store
from reports.bench.study import Bench, Study
from reports.bench.without_paths import without_paths
from reports.errors import OptionError, ReportError
from reports.look.formatting import seconds


@dataclass(frozen=True)
class Request:
    """What the command line requests for all studies that it names."""

    store: Store
    words: Sequence[str]  # of the command line, for the record
    quick: bool = False
    again: bool = False  # measure also what this commit has measured
    cases: Sequence[str] = ()
    budget: float = 3600.0  # [s] of a case that has no end
    options: Mapping[str, str] = field(default_factory=dict)
    folder: Path = Path("reports/out")


def cases_of(name: str, study: Study, request: Request) -> list[str]:
    """Return the cases of a study that a request is about.

    Raises
    ------
    ReportError
        If the study has not such an option or case.
    """
    if unknown := set(request.options) - set(study.options):
        possible = ", ".join(study.options) or "none"
        raise ReportError(
            f"study {name} has no option {min(unknown)!r}; there are: {possible}"
        )
    return study.chosen(request.cases, request.quick)


def run_study(name: str, study: Study, request: Request, show: Show) -> list[str]:
    """Measure the cases of a study and store their rows; return the faults.

    A case that raises has a row "fault", and the others are measured all the same. After
    an interrupt (KeyboardInterrupt, which leaves) the store has every case that ended.

    Raises
    ------
    ReportError
        If a case is unknown, an option is wrong, or the store cannot be read.
    """
    cases = cases_of(name, study, request)
    store = request.store
    run = Run(
        run=uuid4().hex[:8],
        quick=request.quick,
        options=dict(request.options),
        **circumstances("reports", request.words),
    )
    earlier, lines = store.everything(name), store.lines(name)
    left = [
        case
        for case in cases
        if request.again or study.goes_on or not _measured(case, study, run, lines)
    ]
    store.append(name, [run])
    if cases and not left:
        show(f"{name}: all is measured at this commit; --again measures it again")
    faults: list[str] = []
    whole = Bench(
        name,
        request.quick,
        show,
        request.folder,
        request.budget,
        request.options,
        earlier,
    )
    began, expected = time.monotonic(), _expected(study, request.quick)
    usual = len(study.chosen((), request.quick))
    with study.session(left, whole) if left else nullcontext() as session:
        for number, case in enumerate(left):
            gone = time.monotonic() - began
            each = gone / number if number else expected / max(1, usual)
            remaining = seconds(each * (len(left) - number))
            place = f"{name}: {case}, {number + 1} of {len(left)}, about {remaining} left"
            show(place)
            bench = replace(
                whole,
                show=lambda stage, place=place: show(f"{place}: {stage}"),  # type: ignore[misc]
                earlier=earlier.where(case=without_paths(case)),
                session=session,
            )
            faults += _measure(study, case, bench, store, run.run)
    return faults


def _measure(study: Study, case: str, bench: Bench, store: Store, run: str) -> list[str]:
    """Measure a case to its end, or to what it raises; return its faults."""
    name, faults, inputs = bench.study, [], ""
    clock, start = BusyClock(), time.monotonic()
    try:
        inputs = study.inputs(case, bench.options)  # now: files may be edited later
        for row in study.measure(case, bench):
            store.append(name, [replace(row, study=name, run=run)])
            if row.quantity == "fault":
                faults.append(f"{name}: {case}: {row.value}")
    except OptionError:
        raise
    except Exception as error:  # whatever it is, the other cases are measured
        sentence = str(error) if isinstance(error, ValueError) else repr(error)
        row = Row(case=case, quantity="fault", value=sentence, study=name, run=run)
        store.append(name, [row])
        faults.append(f"{name}: {case}: {sentence}")
    done = Done(
        done=case,
        run=run,
        seconds=round(time.monotonic() - start, 3),
        cores_of_other_programs=clock.others(),
        inputs=inputs,
    )
    store.append(name, [done])
    return faults


def _expected(study: Study, quick: bool) -> float:
    minutes = study.quick_minutes if quick else None
    return 60.0 * (study.minutes if minutes is None else minutes)


def _measured(case: str, study: Study, run: Run, lines: Sequence[Line]) -> bool:
    """Return whether this commit has measured a case with the same settings.

    A case with a fault counts as not measured, so that the fault is found and told again.
    """
    stored, inputs = without_paths(case), study.inputs(case, run.options)
    settings = run.commit, run.quick, run.options
    same = {
        line.run
        for line in lines
        if isinstance(line, Run) and (line.commit, line.quick, line.options) == settings
    }
    same -= {
        line.run
        for line in lines
        if isinstance(line, Row) and line.case == stored and line.quantity == "fault"
    }
    return not run.commit.endswith("-dirty") and any(
        isinstance(line, Done)
        and (line.done, line.inputs) == (stored, inputs)
        and line.run in same
        for line in lines
    )
