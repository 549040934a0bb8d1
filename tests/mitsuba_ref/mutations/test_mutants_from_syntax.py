"""Mutants made by machine: which there are, that each can be built, what becomes of them.

The trial is tested on stand-ins: pictures by hand instead of a mutant's, checks that see a
given rung. A real one takes a minute (`python -m mitsuba_ref.mutations --from-syntax 1`).
"""

from __future__ import annotations

import ast
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from mitsuba_ref.mutations import from_syntax, syntax_trial
from mitsuba_ref.mutations import reached_kernels as reached
from mitsuba_ref.mutations.from_syntax import enumerate_mutants, sample
from mitsuba_ref.mutations.mutant import ROOT, MutantError
from mitsuba_ref.mutations.mutation import PACKAGE, mutated_files
from mitsuba_ref.mutations.reached_kernels import compiled_kernels
from mitsuba_ref.mutations.rungs import REPLAY, RUNS, Rung
from mitsuba_ref.mutations.syntax_trial import (
    SCENES,
    UNIT_TESTS,
    Outcome,
    relative_change,
    summary,
    try_mutant,
)

KERNEL = '''
from renderer.kernels.jit import builder_kernel, kernel

@builder_kernel
def build(a):
    return a + 1

@kernel
def shade(a, b, places, i):
    """Not a part of it: 1 + 1."""
    if a < b and not b:
        return -places[i] + 2
    return f(a, b, 0)
'''


@pytest.fixture(scope="module")
def mutants():
    return enumerate_mutants()


def test_a_kernel_by_hand_has_each_kind_of_change(tmp_path):
    """Written down by hand; the docstring and the function that builds have none."""
    (tmp_path / "integrators").mkdir()
    (tmp_path / "integrators" / "own.py").write_text(KERNEL)
    for room in ("dispatch.py",):
        (tmp_path / "accelerators").mkdir()
        (tmp_path / "accelerators" / room).write_text("")
    found = {(m.kind, m.old, m.new) for m in enumerate_mutants(tmp_path)}
    assert found == {
        ("condition", "a < b and not b", "(not (a < b and (not b)))"),
        ("term", "a < b and not b", "(not b)"),
        ("term", "a < b and not b", "(a < b)"),
        ("comparison", "a < b", "(a <= b)"),
        ("comparison", "a < b", "(a > b)"),
        ("term", "not b", "b"),
        ("operator", "-places[i] + 2", "(-places[i] - 2)"),
        ("term", "-places[i] + 2", "(-places[i])"),
        ("term", "-places[i] + 2", "2"),
        ("term", "-places[i]", "places[i]"),
        ("index", "places[i]", "places[i + 1]"),
        ("constant", "2", "4"),
        ("constant", "2", "3"),
        ("constant", "2", "0"),
        ("arguments", "f(a, b, 0)", "f(b, a, 0)"),
        ("constant", "0", "1"),
    }


def test_there_are_over_ten_thousand_each_with_a_name_of_its_own(mutants):
    assert len(mutants) > 10_000
    assert len({mutant.name for mutant in mutants}) == len(mutants)
    assert min(Counter(mutant.kind for mutant in mutants).values()) > 100
    symbols = {mutant.symbol for mutant in mutants}
    assert "integrators.path.follow_paths" in symbols
    assert "plugins.bsdfs.diffuse.eval_pdf" in symbols
    assert not any(symbol.startswith(("replay", "textbook")) for symbol in symbols)


def test_a_sample_is_one_of_its_seed_and_the_beginning_of_a_larger_one(mutants):
    reached = {"integrators.path.follow_paths", "plugins.bsdfs.diffuse.sample"}
    few, more = sample(mutants, 5, 3, reached), sample(mutants, 9, 3, reached)
    assert few == more[:5]
    assert few != sample(mutants, 5, 4, reached)
    assert {mutant.symbol for mutant in sample(mutants, 99, 0, reached)} == reached


def test_those_of_a_sample_can_be_built(mutants):
    """One edit each, and the new file differs from the old one in its syntax."""
    everything = {mutant.symbol for mutant in mutants}
    for mutant in sample(mutants, 40, 1, everything):
        mutation = mutant.mutation("cornell-box")
        ((name, text),) = mutated_files(mutation).items()
        before = (PACKAGE / name).read_text(encoding="utf-8")
        assert ast.dump(ast.parse(text)) != ast.dump(ast.parse(before))


def test_a_file_that_has_changed_since_is_refused(mutants, tmp_path):
    moved = tmp_path / "path.py"
    mutant = next(m for m in mutants if m.symbol == "integrators.path.follow_paths")
    moved.write_bytes(b"# what follows is in other places\n" + mutant.path.read_bytes())
    with pytest.raises((from_syntax.AnchorError, SyntaxError)):
        replace(mutant, path=moved).mutation("cornell-box")


def test_what_the_trial_names_exists():
    for scene in SCENES:
        assert syntax_trial.scene_file(scene).is_file()
    for tests in UNIT_TESTS.values():
        for test in tests:
            file, _, name = test.partition("::")
            (path,) = (ROOT / "tests").rglob(file)
            assert f"def {name or 'test_'}" in path.read_text(encoding="utf-8")


def test_a_compiled_kernel_is_told_and_one_that_is_only_defined_is_not():
    def own(x):
        return x + 1

    own.__module__, own.__qualname__ = "renderer.plugins.own", "own"
    compiled = numba.njit(own)
    assert "plugins.own.own" not in compiled_kernels()
    compiled(1)
    assert "plugins.own.own" in compiled_kernels()


def test_the_kernels_of_a_scene_are_kept_until_a_source_changes(tmp_path, monkeypatch):
    """A process that renders the scene with an empty cache takes a minute."""
    monkeypatch.setattr(reached, "cache_folder", lambda name: tmp_path)
    started = []

    def run(command, **given):
        started.append(command[-1])
        names = '["plugins.bsdfs.diffuse.sample"]'
        return SimpleNamespace(returncode=0, stdout=f"a warning\n{names}\n", stderr="")

    monkeypatch.setattr(reached.subprocess, "run", run)
    scene = tmp_path / "box" / "scene.xml"
    for state in ("now", "now", "later"):
        monkeypatch.setattr(reached, "sources_hash", lambda texts, state=state: state)
        assert reached.reached_kernels(scene) == {"plugins.bsdfs.diffuse.sample"}
    assert started == [str(scene)] * 2


def test_a_change_is_more_than_rounding():
    grey = np.full((4, 5, 3), 0.5, np.float32)
    assert relative_change(grey * np.float32(1.0 + 1e-5), grey) == 0.0
    assert relative_change(grey * np.float32(1.1), grey) == pytest.approx(0.1, rel=1e-5)
    assert relative_change(np.where(grey > 0, np.nan, grey), grey) != 0.0
    assert relative_change(grey[:2], grey) == np.inf


class StandIn:
    """A mutant whose pictures are as bright as the class says."""

    brightness = 1.0
    failed: tuple[str, ...] = ()

    def __init__(self, mutation, time_limit):
        self.mutation = mutation

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def render(self, request):
        if self.brightness < 0.0:
            raise MutantError("Failed in nopython mode pipeline (step: nopython frontend)")
        if self.brightness == 0.0:
            raise MutantError("the process ended with status -11")
        return picture_of(self.brightness)

    def run_tests(self, tests):
        return SimpleNamespace(failed=self.failed, seconds=0.0)


def picture_of(brightness):
    pixels = np.full((4, 5, 3), brightness, np.float32)
    return SimpleNamespace(pixels=pixels, compile_seconds=0.0, spp=1)


@pytest.mark.parametrize(
    ("brightness", "seen", "failed", "verdict", "killed_by"),
    [
        (-1.0, "", (), "does not compile", ""),
        (0.0, "", (), "killed", RUNS),
        (1.0, REPLAY, (), "equivalent", ""),
        (1.5, REPLAY, (), "killed", REPLAY),
        (1.5, "broken anyway", (), "survived", ""),
        (1.5, "", ("test_x.py::test_y",), "killed", "unit tests"),
        (1.5, "", (), "survived", ""),
    ],
)
def test_a_mutant_is_shown_to_one_check_after_the_other(
    mutants, monkeypatch, brightness, seen, failed, verdict, killed_by
):
    monkeypatch.setattr(StandIn, "brightness", brightness)
    monkeypatch.setattr(StandIn, "failed", failed)
    monkeypatch.setattr(syntax_trial, "Mutant", StandIn)
    unchanged = picture_of(1.0).pixels
    monkeypatch.setattr(syntax_trial, "unchanged_picture", lambda scene: unchanged)
    rungs = [Rung(seen, True, "why", 1, 0.0)] if seen else []
    monkeypatch.setattr(syntax_trial, "CHECKS", (lambda *given: rungs,))
    broken = frozenset({"broken anyway"})
    outcome = try_mutant(mutants[0], "cornell-box", None, broken)
    assert (outcome.verdict, outcome.killed_by) == (verdict, killed_by)
    assert outcome.mutant == mutants[0].name


def test_the_summary_counts_those_that_change_a_picture():
    def outcome(verdict, by=""):
        return Outcome("m", "d", "a -> b", "box", verdict, by, change=0.1)

    found = [outcome("killed", "replay")] * 3 + [outcome("survived"), outcome("equivalent")]
    lines = summary(found)
    assert lines[0] == "5 mutants: 3 killed, 1 survived, 1 equivalent"
    assert lines[1].startswith(
        "3 of 4 that change a picture are killed (75%), by: 3 replay"
    )
    assert lines[2].startswith("survived: m on box: a -> b")
