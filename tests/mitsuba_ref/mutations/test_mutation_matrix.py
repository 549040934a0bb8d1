"""The mutation matrix: no defect unseen, no neutral change seen.

What catches the defects is a part of `make test`: the replay of some scenes at their test
size, the comparison of the others, and unit tests. Each row of the matrix asks these on a
copy of the renderer that has the defect, and climbs the ladder of tests, which `make test`
does not: what the ladder alone sees is a hole here.

Seeds are fixed, so that the ladder says the same in each run, until the random numbers of a
renderer change. It claims 0.7 % false alarms for a climb under noise. 40 such climbs have
no defect and numbers of their own: 25 % at most for a false alarm in the whole matrix.
"""

from __future__ import annotations

import pytest
from test_replay_scenes import QUICK as REPLAYED
from test_scenes_against_mitsuba import QUICK

from mitsuba_ref.mutations import climbing
from mitsuba_ref.mutations.climbing import NOT_CLIMBED
from mitsuba_ref.mutations.defects.catalogue import CATALOGUE
from mitsuba_ref.mutations.matrix import OWN_SCENES, control, scene_file, try_mutation
from mitsuba_ref.mutations.rungs import CLIMBED, REPLAY, TESTS, CountedRender, replay
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

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


@pytest.mark.slow
@pytest.mark.parametrize("scene", NOT_CLIMBED)
def test_where_the_ladder_is_not_climbed_it_still_sees_a_difference(
    scene, references, monkeypatch
):
    """A known disagreement: where it ends, the scene's mutations have to climb too.

    The rung "floors" broke in four of four sets of eight seeds, and in all 32 pictures
    together the floor below the lamp differs by 8 times its noise.
    """
    monkeypatch.setattr(climbing, "NOT_CLIMBED", {})
    rungs = climbing.ladder(scene_file(scene), CountedRender(render_ours), references)
    assert any(rung.caught for rung in rungs)


def in_make_test(row):
    """Return the rungs that see a mutation and are a part of `make test` on its scene."""
    folder = scene_file(row.scene).parent
    replayed = folder.name == "plugins" or folder.parent == OWN_SCENES
    every_day = {TESTS: True, REPLAY: replayed or row.scene in REPLAYED}
    every_day |= dict.fromkeys(CLIMBED, False)
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
