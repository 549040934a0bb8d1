"""Tests of the tests: does a defect reach the checks, and does a check then see it?

The mechanism by itself, and a few cheap mutants from end to end. The whole matrix is in
`test_mutation_matrix.py`.
"""

from __future__ import annotations

import ast
import dataclasses
import re
from pathlib import Path

import pytest
from numba.core.errors import TypingError

from mitsuba_ref.ladder.aovs import compare_aovs
from mitsuba_ref.mutations.defects.catalogue import CATALOGUE, named
from mitsuba_ref.mutations.matrix import Row, control, scene_file
from mitsuba_ref.mutations.mutant import ROOT, Mutant, MutantError
from mitsuba_ref.mutations.mutation import (
    PACKAGE,
    Mutation,
    mutant_folder,
    mutated_files,
)
from mitsuba_ref.mutations.rungs import (
    AOVS,
    FINITE,
    LADDER,
    REPLAY,
    RUNS,
    STATISTICS,
    Rung,
    rungs_of,
)
from mitsuba_ref.mutations.source_edit import AnchorError, Edit
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import Finite, SceneResult
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.errors import SceneError
from renderer.kernels.jit import entry_kernel

every_mutation = pytest.mark.parametrize("mutation", CATALOGUE, ids=lambda m: m.name)


# --------------------------------------------------------------------------- the catalogue


@every_mutation
def test_it_still_fits_the_source(mutation):
    """An anchor that has moved would test nothing: each is there exactly once."""
    for name, text in mutated_files(mutation).items():
        ast.parse(text, name)


@every_mutation
def test_what_it_names_exists(mutation):
    """A scene with its test size, and tests of the suite that are not slow ones."""
    scene = scene_file(mutation.scene)
    assert scene.is_file()
    assert scene.parent.name == "plugins" or scene.with_name("proof.toml").is_file()
    for test in mutation.tests:
        name, _, function = test.partition("[")[0].partition("::")
        source = next((ROOT / "tests").rglob(name)).read_text(encoding="utf-8")
        found = re.search(rf"(@pytest\.mark\.slow\n)?(@.*\n)*def {function}\(", source)
        assert found, test
        assert not found[1], f"{test} is not a part of make test"


def test_there_are_enough_of_both_kinds_and_names_are_unique():
    harmful = [mutation.harmful for mutation in CATALOGUE]
    assert harmful.count(True) >= 170
    assert harmful.count(False) >= 7
    names = [mutation.name for mutation in CATALOGUE]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch("[a-z0-9-]+", name) for name in names)


def test_mutations_are_found_by_name():
    assert named([]) == list(CATALOGUE)
    assert [m.name for m in named(["gamma-twice"])] == ["gamma-twice"]
    with pytest.raises(KeyError, match="no mutation gama; there are: cosine-dropped, "):
        named(["gama"])


def test_the_renderer_knows_nothing_of_mutations():
    """What runs every day must hold no switch for a defect."""
    for source in PACKAGE.rglob("*.py"):
        text = source.read_text(encoding="utf-8")
        assert not re.search(r"\bmutation|\bmutant", text), source


# --------------------------------------------------------------------------- the mechanism


def mutation(*edits: tuple[str, str, str], name: str = "made-up") -> Mutation:
    return Mutation(name, "for a test", tuple(Edit(*e) for e in edits), "grey-furnace")


SOURCE = """
LIMIT = 3


class Camera:
    def shift(self):
        return self.x + self.x


@decorated
def shift(
    x, y
):
    # a comment, and a line for each argument
    return clamp(
        x + 0.5,  # half a pixel
        y,
    )
"""


@pytest.fixture
def package(tmp_path):
    """A package with two modules; `outer.reach` is there in both."""
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "camera.py").write_text(SOURCE)
    (tmp_path / "deep" / "other.py").write_text("def reach():\n    return 1\n")
    (tmp_path / "film.py").write_text("def reach():\n    return 2\n")
    return tmp_path


def edited(package, symbol, old, new):
    [text] = mutated_files(mutation((symbol, old, new)), package).values()
    return text


@pytest.mark.parametrize(
    ("symbol", "old", "new", "line"),
    [
        ("camera.LIMIT", "3", "4", "LIMIT = 4"),
        ("Camera.shift", "self.x +", "self.y +", "        return self.y + self.x"),
        ("camera.shift", "x + 0.5", "x", "        x,  # half a pixel"),
        ("camera.shift", "return clamp(x + 0.5, y)", "return x, y", "    return x, y"),
        ("camera.shift", "return", "x = y\nreturn", "    x = y\n    return clamp("),
        ("old_module.LIMIT", "3", "4", "LIMIT = 4"),  # it has moved to `camera`
        ("camera.py", "class Camera", "class Lens", "class Lens:"),
    ],
)
def test_text_is_replaced_in_the_named_definition_however_it_is_laid_out(
    package, symbol, old, new, line
):
    assert f"\n{line}" in edited(package, symbol, old, new)


@pytest.mark.parametrize(
    ("symbol", "old", "complaint"),
    [
        ("camera.shift", "no such text", "found it 0 times; the text is in: no definition"),
        ("camera.shift", "self.x + self", "found it 0 times; .*: camera.*Camera.shift"),
        ("Camera.shift", "self.x", "exactly once in .*camera.py, lines 6 to 7, found it 2"),
        ("camera.shift", "x", "replaced by itself"),
        ("camera.shfit", "x + 0.5", "no such definition; similar: camera.shift"),
        (
            "old_module.reach",
            "1",
            "several .*: deep.other.reach, film.reach; ",
        ),
        ("gone.py", "x", "mutation made-up: gone.py: no such definition"),
    ],
)
def test_a_mutation_that_does_not_fit_is_an_error_that_names_what_does(
    package, symbol, old, complaint
):
    with pytest.raises(AnchorError, match=complaint):
        edited(package, symbol, old, "x")


def test_a_changed_source_is_read_again(package):
    """A matrix runs for hours, while others edit the work tree."""
    edited(package, "film.reach", "2", "5")
    source = package / "film.py"
    source.write_text("LIMIT = 1\n\n\n" + source.read_text())
    assert edited(package, "film.reach", "2", "5").endswith("return 5\n")


def test_two_edits_of_one_file_are_both_made():
    edits = [
        ("srgb.srgb_from_linear", "12.92", "13.0"),
        ("srgb.srgb_from_linear", "1.055 *", "1.0 *"),
    ]
    text = mutated_files(mutation(*edits))["rendering/picture/picture.py"]
    assert "13.0" in text and "12.92" not in text and "1.0 *" in text


def test_a_copy_differs_in_the_mutated_file_alone_and_is_found_again(tmp_path):
    """Numba finds kernels by path and time of a source: a copy must not be made twice."""
    made = mutation(("srgb.srgb_from_linear", "12.92", "13.0"))
    folder = mutant_folder(made, tmp_path)
    sources = sorted(p.relative_to(PACKAGE) for p in PACKAGE.rglob("*.py"))
    assert sorted(p.relative_to(folder / "renderer") for p in folder.rglob("*.py")) == (
        sources
    )
    differing = [
        s.as_posix()
        for s in sources
        if (folder / "renderer" / s).read_bytes() != (PACKAGE / s).read_bytes()
    ]
    assert differing == ["rendering/picture/picture.py"]
    before = (folder / "renderer" / "rendering/picture/picture.py").stat().st_mtime_ns
    assert mutant_folder(made, tmp_path) == folder
    assert (
        folder / "renderer" / "rendering/picture/picture.py"
    ).stat().st_mtime_ns == before


def test_a_changed_mutation_has_another_folder_and_the_old_one_goes(tmp_path):
    first = mutant_folder(mutation(("srgb.srgb_from_linear", "12.92", "13.0")), tmp_path)
    other = mutant_folder(
        mutation(("srgb.srgb_from_linear", "12.92", "13.0"), name="made"), tmp_path
    )
    second = mutant_folder(mutation(("srgb.srgb_from_linear", "12.92", "14.0")), tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([other, second])
    assert first != second


def request() -> RenderRequest:
    size = {"width": "8", "height": "6", "spp": "1"}
    return RenderRequest(str(scene_file("grey-furnace")), parameters=size, threads=1)


PLACE = "return finish(begin(scene"


@pytest.mark.parametrize(
    ("statement", "complaint"),
    [
        ("raise ValueError('broken')", "ValueError: broken"),
        ("__import__('os')._exit(3)", "the process ended with status 3"),
        ("__import__('time').sleep(600)", "no answer within 4 s"),
    ],
    ids=["raises", "crashes", "hangs"],
)
def test_a_mutant_that_breaks_is_an_error_and_not_a_wait(tmp_path, statement, complaint):
    """Harmful text may do anything to its process, and nothing to ours."""
    limit = 4.0 if "sleep" in statement else 120.0
    made = mutation(("render.render_with", PLACE, f"{statement}\n{PLACE}"))
    with Mutant(made, limit, tmp_path) as mutant:
        with pytest.raises(MutantError, match=complaint):
            mutant.render(request())


def test_a_refusal_arrives_as_what_it_is(tmp_path):
    """A scene that cannot be rendered or replayed is none that a mutation has broken."""
    content = scene_file("grey-furnace").read_text(encoding="utf-8")
    scene = tmp_path / "scene.xml"
    scene.write_text(content.replace('type="sphere"', 'type="hypercube"'))
    made = mutation(("srgb.srgb_from_linear", "12.92", "13.0"))
    with Mutant(made, 120.0, tmp_path) as mutant:
        with pytest.raises(SceneError, match="hypercube"):
            mutant.render(dataclasses.replace(request(), path=str(scene)))


def test_kernels_are_compiled_again_only_where_one_is_changed(tmp_path, monkeypatch):
    """And then in a cache of the mutant's own: no other process may find them."""
    monkeypatch.setenv("LIGHTPROOF_CACHE", "ours")
    for made in named(["gamma-twice", "tiles-in-reverse", "mirrored-picture"]):
        with Mutant(made, 6.0, tmp_path) as mutant:
            own = str(mutant.folder / "cache")
            expected = own if made.name == "mirrored-picture" else "ours"
            assert mutant._environment()["LIGHTPROOF_CACHE"] == expected


def test_tests_that_do_not_end_are_stopped(tmp_path):
    made = mutation(("srgb.srgb_from_linear", "def", "while True: pass\n\ndef"))
    with Mutant(made, 6.0, tmp_path) as mutant:
        with pytest.raises(MutantError, match="tests did not end within 6 s"):
            mutant.run_tests(("test_image.py",))


# ------------------------------------------------------------------------- from end to end


def test_a_defect_outside_of_the_picture_is_seen_by_a_test_of_the_suite(tmp_path):
    """PNG gamma twice: the picture is right, the file is not."""
    [gamma] = named(["gamma-twice"])
    with Mutant(gamma, 120.0, tmp_path) as mutant:
        run = mutant.run_tests(gamma.tests)
    assert run.failed == ("test_image.py::test_png_is_the_nearest_srgb_level",)


def test_the_same_test_passes_on_the_unchanged_renderer(tmp_path):
    """By the same mechanism, so that it is the defect that was seen."""
    [gamma] = named(["gamma-twice"])
    with Mutant(control("grey-furnace"), 120.0, tmp_path) as mutant:
        assert mutant.run_tests(gamma.tests).failed == ()


NARROWER = mutation(  # in a file from which no kernel is compiled
    ("sensors.read_fov_x", "return fov_x", "return 0.9 * fov_x"),
    name="narrower",
)


@pytest.mark.parametrize(
    ("changed", "seen"),
    [(NARROWER, True), (named(["tiles-in-reverse"])[0], False)],
    ids=lambda value: getattr(value, "name", None),
)
def test_what_the_camera_sees_is_seen_by_the_aovs(changed, seen):
    """A defect is caught by the depths and normals, a neutral change is not.

    Defects of kernels are the matrix's: they are compiled anew, which takes 14 s.
    """
    wanted = RenderRequest(
        str(scene_file("cornell-box")),
        {"width": "48", "height": "48", "spp": "1"},
        kind="aovs",
        threads=2,
        box_filter=True,
    )
    with Mutant(changed) as mutant, MitsubaWorker(120.0) as worker:
        ours = mutant.render(wanted)
        reference = ReferenceCache(worker.render).get(wanted, ours.files)
    failed = [
        aov.name for aov in compare_aovs(ours.arrays, reference.arrays) if not aov.passed
    ]
    assert ("depth" in failed) == seen, failed
    assert bool(failed) == seen, failed


# ---------------------------------------------------------------------- rungs and the rows


def result(**fields) -> SceneResult:
    return SceneResult(name="made up", **{"verdict": "fail", **fields})


def caught(rungs: list[Rung]) -> list[str]:
    return [rung.name for rung in rungs if rung.caught]


def test_reasons_are_sorted_by_the_rung_that_gives_them():
    said = result(reasons=("AOV uv 0.5 over 0.001", "rmse 2 over 1"))
    rungs = rungs_of(said, 32, 1.5)
    assert [rung.name for rung in rungs] == [RUNS, FINITE, AOVS, STATISTICS]
    assert caught(rungs) == [AOVS, STATISTICS]
    assert [rung.why for rung in rungs][2:] == list(said.reasons)
    assert [rung.spp for rung in rungs] == [32, 32, 1, 32]


def test_a_refusal_and_a_nan_end_the_ladder():
    crashed = rungs_of(result(verdict="broken", reasons=("it broke",)), None, 0.0)
    assert [(rung.name, rung.caught) for rung in crashed] == [(RUNS, True)]
    nan = result(verdict="not-finite", finite=Finite(ours_nan=1), reasons=("NaN",))
    assert caught(rungs_of(nan, 1, 0.0)) == [FINITE]


def test_a_failure_of_mitsuba_is_no_sign_of_a_defect():
    """Or a crash of the reference would close every hole of the matrix."""
    with pytest.raises(MitsubaError, match="mitsuba-timeout: silent"):
        rungs_of(result(verdict="mitsuba-timeout", reasons=("silent",)), None, 0.0)


def row(harmful: bool, *names: str, broken: tuple[str, ...] = ()) -> Row:
    rungs = tuple(
        Rung(name, name in names, "", 1, 0.0) for name in LADDER if name not in broken
    )
    return Row("made-up", "for a test", harmful, "none", rungs, 0.0, broken=broken)


def test_a_row_says_who_saw_it_first():
    seen = row(True, STATISTICS, REPLAY)
    assert (seen.caught_by, seen.as_expected) == (REPLAY, True)


def test_a_hole_and_a_false_alarm_are_not_as_expected():
    assert not row(True).as_expected
    assert not row(False, AOVS).as_expected
    assert row(False).as_expected


def test_a_rung_that_sees_the_unchanged_renderer_proves_nothing():
    assert not row(True, AOVS, broken=(REPLAY,)).as_expected


def test_a_mutant_that_numba_refuses_shows_nothing():
    """The edit no longer fits what is around it: no check has seen the defect."""

    @entry_kernel
    def broken(x):
        return x.no_such_thing

    with pytest.raises(TypingError) as error:
        broken(1.0)
    why = str(error.value)
    refused = Row("m", "d", True, "none", (Rung(RUNS, True, why, None, 0.0),), 0.0)
    assert not refused.compiles
    assert not refused.as_expected
    crashed = Row("m", "d", True, "none", (Rung(RUNS, True, "died", None, 0.0),), 0.0)
    assert crashed.as_expected


def test_scenes_of_the_mutations_come_before_those_of_the_demo():
    assert scene_file("lamp-in-glass").parent.parent.name == "scenes"
    assert scene_file("lamp-in-glass").is_relative_to(Path(ROOT) / "mitsuba_ref")
    assert scene_file("cornell-box") == ROOT / "scenes" / "cornell-box" / "scene.xml"
