"""Mutants made by machine, each shown to one check after the other until one sees it.

A mutant whose small picture stays the same but for rounding is not judged: it is equivalent
on its scene. Of the others, those that no check sees are listed: each is equivalent for
another reason, or a test is missing.
"""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.mutations.from_syntax import SyntaxMutant
from mitsuba_ref.mutations.matrix import (
    CHECKS,
    SharedReferences,
    control,
    refused_by_numba,
    scene_file,
    try_mutation,
)
from mitsuba_ref.mutations.mutant import Mutant, MutantError
from mitsuba_ref.mutations.mutation import mutant_name
from mitsuba_ref.mutations.reached_kernels import picture_request, reached_kernels
from mitsuba_ref.mutations.rungs import RUNS, TESTS, CountedRender, Rung
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.json_files import from_json, write_json
from mitsuba_ref.reference.cache import ReferenceCache
from renderer.errors import NotReplayable, SceneError
from renderer.process.cache_folder import cache_folder

SCENES = (
    "cornell-box",
    "nested-bsdfs",
    "rough-metal-and-glass",
    "textures",
    "plastics",
    "instances",
    "principled",
    "textured-room",
)
"""Small scenes that together need most kernels; those that compile sooner come first."""

TIME_LIMIT = 3600.0
"""Seconds for one picture, for what waits for ever. An endless loop ends sooner, by
`mutant_process.PROCESSOR_LIMIT`."""

ROUNDING = 1e-4
"""Relative to a pixel and to the picture's mean: less is not called a change. The mutant is
compiled with fewer optimisations than the picture that it is compared with."""

UNIT_TESTS: dict[str, tuple[str, ...]] = {
    "": ("test_simple_path_tracer.py::test_the_same_paths_find_the_same_light",),
    "plugins.sampling": (
        "test_simple_path_tracer.py::test_the_numbers_are_those_of_the_kernels",
    ),
    "accelerators": ("test_accelerators_agree.py",),
}
"""Tests against `renderer.simple` and against brute force, by the beginning of a
definition's name: what no other check has seen is shown to them."""

Verdict = Literal["does not compile", "equivalent", "killed", "survived"]


@dataclass(frozen=True)
class Outcome:
    """What became of one mutant on one scene."""

    mutant: str
    definition: str
    does: str
    scene: str
    verdict: Verdict
    killed_by: str = ""  # a rung of the matrix
    why: str = ""  # the first words of the check
    change: float | None = None  # root mean square, of the picture's mean; None: no picture
    seconds: float = 0.0


def scenes_by_kernel(scenes: Sequence[str] = SCENES) -> dict[str, str]:
    """Return the first scene that needs a kernel, for all that one of them needs."""
    found: dict[str, str] = {}
    for scene in scenes:
        found |= dict.fromkeys(reached_kernels(scene_file(scene)) - found.keys(), scene)
    return found


def try_mutant(
    mutant: SyntaxMutant,
    scene: str,
    references: ReferenceCache,
    broken: frozenset[str] = frozenset(),
) -> Outcome:
    """Show one mutant to the checks, from cheap to dear, until one sees it.

    Parameters
    ----------
    mutant, scene
        The change, and a scene that needs its kernel.
    references
        Mitsuba's pictures.
    broken
        Rungs that see a difference in the unchanged renderer.
    """
    started = time.perf_counter()
    mutation = mutant.mutation(scene)

    def outcome(verdict: Verdict, rung: Rung | None = None) -> Outcome:
        return Outcome(
            mutant.name,
            mutant.symbol,
            mutant.does,
            scene,
            verdict,
            rung.name if rung else "",
            rung.why[:300] if rung else "",
            change,
            round(time.perf_counter() - started, 1),
        )

    change: float | None = None
    request = picture_request(scene_file(scene))
    with Mutant(mutation, TIME_LIMIT) as harmed:
        try:
            picture = harmed.render(request).pixels
        except (MutantError, SceneError, NotReplayable) as error:
            if refused_by_numba(str(error)):
                return outcome("does not compile")
            return outcome("killed", Rung(RUNS, True, str(error), None, 0.0))
        change = relative_change(picture, unchanged_picture(scene_file(scene)))
        if change == 0.0:
            return outcome("equivalent")
        ours = CountedRender(harmed.render)
        for check in CHECKS:
            for rung in check(scene_file(scene), ours, references):
                if rung.caught and rung.name not in broken:
                    return outcome("killed", rung)
        for start, tests in UNIT_TESTS.items():
            if mutant.symbol.startswith(start):
                try:
                    run = harmed.run_tests(tests)
                except MutantError as error:  # pytest died, or did not end
                    return outcome("killed", Rung(TESTS, True, str(error), None, 0.0))
                if run.failed:
                    failed = "; ".join(run.failed)
                    return outcome("killed", Rung(TESTS, True, failed, None, run.seconds))
    return outcome("survived")


@cache
def unchanged_picture(scene: Path) -> NDArray[np.float32]:
    """Return the picture that the renderer makes without a defect."""
    return render_ours(picture_request(scene), light_choice=None).pixels


def relative_change(picture: NDArray[np.float32], unchanged: NDArray[np.float32]) -> float:
    """Return the root mean square of a change, of the picture's mean; 0 for rounding."""
    if picture.shape != unchanged.shape:
        return float("inf")
    before = unchanged.astype(np.float64)
    mean = float(np.abs(before).mean()) or 1.0
    difference = np.abs(picture - before)
    same = difference <= ROUNDING * (np.abs(before) + mean)  # false for NaN
    return 0.0 if same.all() else float(np.sqrt(np.mean(difference**2))) / mean


def try_sample(
    mutants: Iterable[SyntaxMutant],
    scenes: Mapping[str, str],
    references: ReferenceCache,
    tell: Callable[[Outcome], None] = lambda outcome: None,
    jobs: int = 1,
) -> list[Outcome]:
    """Return what became of each mutant; outcomes of the same sources are kept.

    Parameters
    ----------
    mutants
        To be tried.
    scenes
        Of each definition (`scenes_by_kernel`).
    references
        Mitsuba's pictures.
    tell
        Gets each outcome as soon as it is there.
    jobs
        Mutants at a time; each compiles on one core.
    """
    shared = SharedReferences(references)
    broken: dict[str, frozenset[str]] = {}
    controls, told = Lock(), Lock()

    def broken_on(scene: str) -> frozenset[str]:
        with controls:
            if scene not in broken:
                rungs = try_mutation(control(scene), shared).rungs
                broken[scene] = frozenset(rung.name for rung in rungs if rung.caught)
            return broken[scene]

    def one(mutant: SyntaxMutant) -> Outcome:
        scene = scenes[mutant.symbol]
        folder = mutant_name(mutant.mutation(scene))
        kept = cache_folder("mutants") / "outcomes" / f"{folder}.json"
        outcome = from_json(kept.read_bytes(), Outcome) if kept.is_file() else None
        # a survivor is tried again: it may have got its test since
        if outcome is None or outcome.verdict == "survived":
            outcome = try_mutant(mutant, scene, shared, broken_on(scene))
            write_json(outcome, kept)
            # its kernels take 5 MB
            shutil.rmtree(cache_folder("mutants") / folder, ignore_errors=True)
        with told:
            tell(outcome)
        return outcome

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, mutants))


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """Return the outcomes in lines: how many of each, killed by what, which survived."""
    verdicts = Counter[str](outcome.verdict for outcome in outcomes)
    judged = verdicts["killed"] + verdicts["survived"]
    lines = [f"{len(outcomes)} mutants: " + _counted(verdicts)]
    if judged:
        share = verdicts["killed"] / judged
        lines.append(
            f"{verdicts['killed']} of {judged} that change a picture are killed "
            f"({share:.0%}), by: {_counted(Counter(o.killed_by for o in outcomes))}"
        )
    lines += [
        f"survived: {o.mutant} on {o.scene}: {o.does} (picture changed by {o.change:.2g})"
        for o in outcomes
        if o.verdict == "survived"
    ]
    return lines


def _counted(counts: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.most_common() if name)
