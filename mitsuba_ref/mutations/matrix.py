"""The mutation matrix: every mutation against every check."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mitsuba_ref.mutations.climbing import ladder
from mitsuba_ref.mutations.mutant import ROOT, Mutant, MutantError
from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.mutations.rungs import (
    LADDER,
    RUNS,
    TESTS,
    Check,
    CountedRender,
    Rung,
    comparison,
    replay,
)
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.render import Reference

CHECKS: tuple[Check, ...] = (comparison, replay, ladder)
"""All that a mutant is shown to, from cheap to dear; unit tests come after them."""

OWN_SCENES = Path(__file__).with_name("scenes")

UNCHANGED = "unchanged"
"""The name of the mutation that changes nothing."""


@dataclass(frozen=True)
class Row:
    """One mutation, and what each rung says of it, in the order of the ladder."""

    mutation: str
    does: str
    harmful: bool
    scene: str
    rungs: tuple[Rung, ...]
    compile_seconds: float
    remark: str = ""
    # rungs that see a difference in the unchanged renderer as well, and so say nothing
    broken: tuple[str, ...] = ()
    commit: str = ""  # of the sources that it was measured with

    @property
    def caught_by(self) -> str | None:
        """The first rung that sees the mutation."""
        return next((rung.name for rung in self.rungs if rung.caught), None)

    @property
    def compiles(self) -> bool:
        """Whether there was a mutant to render: Numba may refuse what was edited."""
        return not any(r.name == RUNS and refused_by_numba(r.why) for r in self.rungs)

    @property
    def as_expected(self) -> bool:
        """Harmful and seen, or neutral and not seen, by rungs that mean something."""
        seen = self.caught_by is not None
        return seen == self.harmful and not self.broken and self.compiles


def refused_by_numba(message: str) -> bool:
    """Return whether an error says that a kernel does not compile."""
    return "Failed in nopython mode pipeline" in message  # Numba's words


class SharedReferences(ReferenceCache):
    """Mitsuba's pictures for several threads: it renders one at a time."""

    def __init__(self, references: ReferenceCache) -> None:
        super().__init__(references._render, references.folder)
        self._alone = threading.Lock()

    def get(self, request: RenderRequest, files: Sequence[str | Path]) -> Reference:
        """Return the reference for `request`; see `ReferenceCache.get`."""
        with self._alone:
            return super().get(request, files)


def scene_file(name: str) -> Path:
    """Return the file of a scene: a small one of the mutations, of a plugin, of scenes/."""
    own = OWN_SCENES / name / "scene.xml"
    plugin = ROOT / "tests" / "plugins" / f"{name}.xml"
    for path in (own, plugin):
        if path.is_file():
            return path
    return ROOT / "scenes" / name / "scene.xml"


def control(scene: str) -> Mutation:
    """Return the mutation that changes nothing: what sees it is broken."""
    does = "nothing: the renderer as it is, by the same mechanism"
    return Mutation(UNCHANGED, does, (), scene, harmful=False)


def try_mutation(
    mutation: Mutation, references: ReferenceCache, broken: Iterable[str] = ()
) -> Row:
    """Show one mutation to every check.

    Parameters
    ----------
    mutation
        What to change.
    references
        Mitsuba's pictures.
    broken
        Rungs that see the unchanged renderer: they are left out, and named.

    Raises
    ------
    AnchorError
        If the mutation does not fit the sources.
    MitsubaError
        If Mitsuba cannot render the scene.
    """
    rungs: list[Rung] = []
    with Mutant(mutation) as mutant:
        ours = CountedRender(mutant.render)
        for check in CHECKS:
            rungs += check(scene_file(mutation.scene), ours, references)
        rungs += _unit_tests(mutant)
    best = {rung.name: rung for rung in sorted(rungs, key=lambda rung: rung.caught)}
    return Row(
        mutation.name,
        mutation.does,
        mutation.harmful,
        mutation.scene,
        tuple(best[name] for name in LADDER if name in best and name not in broken),
        round(ours.compile_seconds, 1),
        mutation.remark,
        tuple(sorted(broken)),
    )


def _unit_tests(mutant: Mutant) -> list[Rung]:
    tests = mutant.mutation.tests
    if not tests:
        return []
    try:
        run = mutant.run_tests(tests)
    except MutantError as error:
        return [Rung(TESTS, True, str(error), None, mutant.time_limit)]
    return [Rung(TESTS, bool(run.failed), "; ".join(run.failed), None, run.seconds)]
