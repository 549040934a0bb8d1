"""Soaking: long trials that look for what is too rare for a test, and go on for ever."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from reports.bench.rows import Row
from reports.bench.steps import Step, Sums, rows_of, sums_of
from reports.bench.study import Bench, Study, described
from reports.pages.soak_page import soaked
from reports.trials.soaking import leaks, self_hits
from reports.trials.soaking.damaged_files import damaged_file_steps
from reports.trials.soaking.growth import growth_steps
from reports.trials.soaking.interrupts import interrupt_steps

QUICK = 20.0  # [s] of a trial


@dataclass(frozen=True)
class Trial:
    """One trial, a case of the study.

    `steps` takes what was done so far, when to stop (of `time.monotonic`) and the folder of
    the page. `aims` are of some counts: a sum hides that one of them is behind.
    """

    unit: str
    aim: int
    steps: Callable[[Sums, float, Path], Generator[Step]]
    aims: Mapping[str, int] = field(default_factory=dict)

    def complete(self, so_far: Sums) -> bool:
        """Return whether nothing is left to do."""
        return so_far.done >= self.aim and all(
            so_far.counts[name] >= aim for name, aim in self.aims.items()
        )


TRIALS = {
    "rays": Trial(
        "rays",
        sum(leaks.AIMS.values()),
        lambda so_far, deadline, _: leaks.ray_steps(so_far, deadline),
        leaks.AIMS,
    ),
    "self-hits": Trial(
        "rays",
        self_hits.AIM,
        lambda so_far, deadline, _: self_hits.self_hit_steps(so_far.done, deadline),
    ),
    "damaged-files": Trial(
        "files",
        1_000_000,
        lambda so_far, deadline, out: damaged_file_steps(
            so_far.done, deadline, out / "damaged-files"
        ),
    ),
    "interrupts": Trial(
        "interrupts",
        1000,
        lambda so_far, deadline, _: interrupt_steps(so_far.done, deadline),
    ),
    "growth": Trial(
        "pictures",
        1_000_000,
        lambda so_far, deadline, _: growth_steps(1_000_000 - so_far.done, deadline),
    ),
}


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Go on with a trial for its budget, or until it is complete."""
    trial, so_far = TRIALS[case], sums_of(bench.earlier)
    if not trial.complete(so_far):
        yield from rows_of(_steps(trial, so_far, bench), case, trial.unit)


def _steps(trial: Trial, so_far: Sums, bench: Bench) -> Generator[Step]:
    budget = min(bench.budget, QUICK) if bench.quick else bench.budget
    with closing(trial.steps(so_far, time.monotonic() + budget, bench.folder)) as steps:
        for step in steps:
            so_far.add(step, 0.0)
            faults = f", {len(so_far.faults)} faults" if so_far.faults else ""
            bench.show(f"{so_far.done:,} of {trial.aim:,} {trial.unit}{faults}")
            yield step
            if trial.complete(so_far):
                return


STUDY: Study = described(
    "soak",
    cases=tuple(TRIALS),
    goes_on=True,
    aims={name: trial.aim for name, trial in TRIALS.items()},
    verdict=lambda table: soaked(STUDY, table).verdict,
    measure=measure,
)
