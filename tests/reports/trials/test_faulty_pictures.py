"""Pictures with a known mistake, as the study `compare` makes them."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_ref.diagnosis.comparison import compare_with_scene
from mitsuba_ref.diagnosis.scene_reference import SceneReference
from mitsuba_ref.mutations.mutation import mutated_files
from reports.bench.rows import Row, Table
from reports.studies import compare
from reports.trials.faulty_pictures import (
    EDITS,
    HOMEWORK,
    SIZE,
    SOURCES,
    right_picture,
    room,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("faulty")
    room(made)
    return made


@pytest.fixture(scope="module")
def reference(folder):
    return SceneReference(folder / "room.xml", SIZE, by="ours")


def test_there_are_enough(folder):
    """At least 60 faulty pictures, of which homework is 20."""
    names = {source: [one.name for one in make(folder)] for source, make in SOURCES.items()}
    assert len(names["homework"]) == len(HOMEWORK) >= 20
    assert sum(map(len, names.values())) >= 150


@pytest.mark.parametrize("mutation", HOMEWORK, ids=lambda m: m.name)
def test_homework_edits_fit_the_simple_renderer(mutation):
    for name, text in mutated_files(mutation).items():
        assert name.startswith("simple/")
        compile(text, name, "exec")


def test_a_right_picture_passes(reference, folder):
    found = compare_with_scene(right_picture(folder / "room.xml", 3), reference)
    assert not found.differs, found.sentences()


@pytest.mark.parametrize("name", sorted(EDITS))
def test_an_edited_picture_gets_its_name(reference, folder, name):
    pixels = EDITS[name](right_picture(folder / "room.xml", 3))
    found = compare_with_scene(np.asarray(pixels, np.float64), reference)
    assert found.diagnosis.names[0] == name, found.sentences()


def test_a_misread_scene_gets_its_name(reference, folder):
    """All whose difference is seen: a bounce more or less is hardly one in this scene."""
    seen = 0
    for picture in SOURCES["scenes read wrongly"](folder):
        if picture.scene == folder / "room.xml":
            found = compare_with_scene(picture.make(), reference)
            if found.differs:
                seen += 1
                right = {picture.name, *picture.also}
                assert found.diagnosis.names[0] in right, found.sentences()
    assert seen >= 8


def test_the_verdict_counts():
    rows = [Row(case="homework", contender=str(k), quantity=compare.RANK, value=k)
            for k in (1, 1, 2, 0)]  # fmt: skip
    rows += [Row(case=compare.RIGHT, contender="x", quantity=compare.ALARMS, value=1)]
    assert compare.verdict(Table(tuple(rows))) == (
        "Of 4 pictures with a known mistake that is seen, 2 get the right name first, 1 "
        "second, 1 not at all. Of 16 right pictures 1 is called different."
    )
