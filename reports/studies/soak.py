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


ABOUT = {
    "rays": "Rays from inside of six closed meshes, most of them in one of 20 triangles, "
    f"the same for each of {len(leaks.STRUCTURES)} structures (brute force, boxes and the "
    "BSP tree have the smallest mesh in the place of large ones), traced to the nearest "
    "hit one by one and in packets, and to any hit. Half go anywhere, half are aimed to "
    "pass edges and vertices at 10^-8 to 10^-2 of an edge. A leak is a ray that meets "
    "nothing. The first 10^9 of each structure are of a triangle test that was not "
    "watertight: rays that passed nearer to an edge than its rounding were counted apart.",
    "self-hits": "Mitsuba's 44 cases: eleven shapes at four places and sizes are hit from "
    "four sizes away, rays leave into the hemisphere above each hit, and none may meet "
    "anything within a thousandth of the shape. Similar shapes stand in for four that this "
    "renderer lacks.",
    "damaged-files": "Every format that is read, and whole scenes: extreme values in "
    "well-formed XML, headers that lie, streams of deflate with flipped bits, and damage "
    "that ignores the format. Each file must end in a SceneError or a finite picture, "
    "within 10 s of processor time and 1 GiB; a warning of NumPy is a fault too. Films "
    "above 16384 pixels and paths above 64 bounces or samples of light are read and not "
    "rendered.",
    "interrupts": "The command in a process of its own, interrupted by Ctrl-C between its "
    "start and after its end: it writes the picture so far or nothing, and one line that "
    "says which. A traceback, a picture that cannot be read, another file, another status "
    "and a program that goes on are faults.",
    "growth": "All scenes of the repository in turn in one process, memory after each "
    "round. The first half of the rounds is left out; the medians of 20 blocks of the "
    "others are tested for a trend (Kendall's S against random orders of the blocks). "
    "Growth is p <= 0.001 and 1 MiB or more: memory without a trend gives a false alarm in "
    "at most 0.1 % of all processes.",
}
STUDY: Study = described(
    "soak",
    cases=tuple(TRIALS),
    about=ABOUT,
    goes_on=True,
    aims={name: trial.aim for name, trial in TRIALS.items()},
    verdict=lambda table: soaked(STUDY, table).verdict,
    measure=measure,
)
