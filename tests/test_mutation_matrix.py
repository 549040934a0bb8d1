"""The mutation matrix: no defect unseen, no neutral change seen.

What catches the defects is a part of `make test`: the replay of some scenes at their test
size, the comparison of the others, and unit tests. Each row of the matrix asks these on a
copy of the renderer that has the defect.
"""

from __future__ import annotations

import pytest
from test_replay_scenes import QUICK as REPLAYED
from test_scenes_against_mitsuba import QUICK

from mitsuba_ref.cache import ReferenceCache
from mitsuba_ref.mutations.catalogue import CATALOGUE
from mitsuba_ref.mutations.matrix import OWN_SCENES, control, scene_file, try_mutation
from mitsuba_ref.mutations.rungs import REPLAY, TESTS, CountedRender, replay
from mitsuba_ref.ours import render_ours
from mitsuba_ref.worker import MitsubaWorker

SCENES = tuple(dict.fromkeys(mutation.scene for mutation in CATALOGUE))


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


@pytest.mark.parametrize("scene", sorted(path.name for path in OWN_SCENES.iterdir()))
def test_the_scenes_of_the_mutations_agree_with_mitsuba(scene, references):
    """They show what no scene of scenes/ does; without a defect no replay may complain."""
    ours = CountedRender(render_ours)
    rungs = replay(scene_file(scene), ours, references)
    assert [(rung.name, rung.why) for rung in rungs if rung.caught] == []


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_nothing_is_seen_where_nothing_was_changed(scene, references):
    """The unchanged renderer by the same mechanism: the matrix's control."""
    row = try_mutation(control(scene), references)
    assert [(rung.name, rung.why) for rung in row.rungs if rung.caught] == []


def in_make_test(row):
    """Return the rungs that see a mutation and are a part of `make test` on its scene."""
    own = (OWN_SCENES / row.scene).is_dir()
    every_day = {TESTS: True, REPLAY: own or row.scene in REPLAYED}
    return [
        rung.name
        for rung in row.rungs
        if rung.caught and every_day.get(rung.name, row.scene in QUICK)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("mutation", CATALOGUE, ids=lambda mutation: mutation.name)
def test_every_defect_is_seen_and_no_neutral_change(mutation, references):
    """About half a minute each: a mutant compiles its own kernels."""
    row = try_mutation(mutation, references)
    assert row.as_expected, [(rung.name, rung.why) for rung in row.rungs if rung.caught]
    assert bool(in_make_test(row)) == mutation.harmful
