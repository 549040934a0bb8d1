"""What a study that goes on does, step by step, and the rows that its steps add up to."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field

from reports.bench.rows import LARGEST, Row, Table

EVERY = 60.0  # [s] between the rows of a trial


@dataclass(frozen=True)
class Step:
    """What one step of a trial did; steps are added up."""

    done: int  # in the trial's unit
    counts: Mapping[str, int] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()  # one sentence each
    curve: tuple[float, ...] = ()  # memory over the run, in MiB


@dataclass
class Sums:
    """All steps together."""

    done: int = 0
    seconds: float = 0.0
    counts: Counter[str] = field(default_factory=Counter)
    largest: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    curve: tuple[float, ...] = ()

    def add(self, step: Step, seconds: float) -> None:
        """Add a step that took so many seconds."""
        self.done += step.done
        self.seconds += seconds
        self.counts.update(step.counts)
        for name, value in step.largest.items():
            self.largest[name] = max(self.largest.get(name, value), value)
        self.faults.extend(step.faults)
        self.curve = step.curve or self.curve

    def rows(self, case: str, unit: str) -> Iterator[Row]:
        """Yield what was added as rows; nothing if no step was added."""
        if not self.seconds:
            return
        yield Row(case=case, quantity="seconds", value=round(self.seconds, 3), unit="s")
        for name, count in self.counts.items():
            yield Row(case=case, contender=name, quantity="count", value=count)
        for name, value in self.largest.items():
            yield Row(case=case, contender=name, quantity=LARGEST, value=value)
        for fault in self.faults:
            yield Row(case=case, quantity="fault", value=fault)
        for k, size in enumerate(self.curve):
            at = 100.0 * k / max(1, len(self.curve) - 1)
            yield Row(case=case, quantity="memory", value=size, unit="MiB", at=at)
        yield Row(case=case, quantity="done", value=self.done, unit=unit)


def sums_of(table: Table) -> Sums:
    """Return what rows of one trial add up to."""
    sums = Sums()
    for row in table:
        value = row.value
        if row.quantity == "fault":
            sums.faults.append(str(value))
        elif isinstance(value, int | float):
            if row.quantity == "done":
                sums.done += int(value)
            elif row.quantity == "seconds":
                sums.seconds += value
            elif row.quantity == "count":
                sums.counts[row.contender] += int(value)
            elif row.quantity == LARGEST:
                known = sums.largest.get(row.contender, value)
                sums.largest[row.contender] = max(known, value)
    return sums


def rows_of(
    steps: Generator[Step], case: str, unit: str, every: float = EVERY
) -> Iterator[Row]:
    """Yield rows with the sum of the steps about once a minute, and at the end.

    Also after an interrupt or an error in a step, which then goes on.

    Parameters
    ----------
    steps
        A generator; it is closed at the end.
    case, unit
        Of the rows.
    every
        Seconds between rows.
    """
    sums = Sums()
    last = begun = time.monotonic()
    with closing(steps):
        try:
            for step in steps:
                now = time.monotonic()
                sums.add(step, now - last)
                last = now
                if now - begun > every:
                    yield from sums.rows(case, unit)
                    sums, begun = Sums(), now
        except (KeyboardInterrupt, Exception):
            yield from sums.rows(case, unit)
            raise
        yield from sums.rows(case, unit)
