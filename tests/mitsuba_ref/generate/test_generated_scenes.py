"""Scenes at random: drawn the same each time, over the whole grammar, and they agree."""

from __future__ import annotations

from collections import Counter
from xml.etree.ElementTree import fromstring

import pytest

from mitsuba_ref.generate.__main__ import seed_of
from mitsuba_ref.generate.changed_scenes import AXES, changed_scenes
from mitsuba_ref.generate.coverage import Coverage, plugins_of
from mitsuba_ref.generate.defects import may_reach
from mitsuba_ref.generate.drawing import scene_text
from mitsuba_ref.generate.judge import AGREE, REFUSED, UNCLASSED, UNKNOWN, Judge, Judgement
from mitsuba_ref.generate.record import ENDED, Record, summary
from mitsuba_ref.generate.scene import BLOCK, Scenes
from mitsuba_ref.generate.scene_edits import plugins
from mitsuba_ref.mutations.defects.catalogue import named
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.scene_file.plugins import supported_plugins, supported_tags

SEED = 2
COUNT, PARTS = 200, 8  # scenes of `make test`, and in how many tests they are


# ----------------------------------------------------------------------------- drawing


def test_a_seed_gives_the_same_files_byte_for_byte():
    """However many scenes were drawn before; another seed gives others."""
    one, other = Scenes(7), Scenes(7)
    first = [one.draw(k) for k in range(20)]
    for number in (13, 3, 19):
        again = other.draw(number)
        assert scene_text(again.root) == scene_text(first[number].root)
        assert again.files == first[number].files
    assert scene_text(Scenes(8).draw(3).root) != scene_text(first[3].root)


def test_a_scene_far_along_is_that_of_its_block():
    far = Scenes(7)
    a = scene_text(far.draw(BLOCK + 2).root)
    ascending = Scenes(7)
    for number in range(BLOCK, BLOCK + 2):
        ascending.draw(number)
    assert scene_text(ascending.draw(BLOCK + 2).root) == a


def test_every_supported_plugin_is_drawn_within_a_block():
    """But our own shape."""
    scenes, drawn = Scenes(1), set()
    for number in range(BLOCK):
        drawn |= set(plugins_of(scenes.draw(number).root))
    wanted = {
        f"{tag} {plugin}" for tag in supported_tags() for plugin in supported_plugins(tag)
    }
    wanted -= {"scene scene", "shape implicit"}
    assert wanted <= drawn, wanted - drawn


def test_what_was_drawn_seldom_is_drawn_rather():
    """In 30 scenes no filter is drawn more than three times as often as another."""
    scenes, counts = Scenes(5), Counter()
    for number in range(30):
        counts.update(e.get("type") for e in scenes.draw(number).root.iter("rfilter"))
    assert len(counts) == 6
    assert max(counts.values()) <= 3 * min(counts.values())


def test_pairs_are_counted():
    coverage = Coverage()
    coverage.add(Scenes(1).draw(0).root)
    assert coverage.counts["film hdrfilm + sensor thinlens"] == 1
    assert coverage.weight("sensor thinlens", ["film hdrfilm"]) == pytest.approx(1 / 3)
    assert coverage.share("film hdrfilm.width") == pytest.approx(0.5)


def test_a_plugin_of_a_scene_is_found():
    root = Scenes(1).draw(0).root
    assert len(plugins(root, "sensor", "perspective", "thinlens")) == 1
    assert plugins(root, "sensor", "perspective") == []


def test_a_seed_of_the_week_is_a_number():
    assert 202600 < seed_of("week") < 300000
    assert seed_of("12") == 12


# ------------------------------------------------------------------------------ record


def test_a_record_goes_on_and_an_ended_scene_is_not_tried_again(tmp_path):
    path = tmp_path / "record.jsonl"
    record = Record(3, path)
    record.begin(0)
    record.add(0, Judgement(AGREE, "all", brightness=0.5))
    record.begin(1)
    record.add(1, Judgement(UNKNOWN, "apart", "hits", (2, 3)))
    record.begin(2)
    record.add_circumstances({"commit": "none"})
    with path.open("a") as file:
        file.write('{"seed": 3, "num')  # the process was ended
    again = Record(3, path)
    assert again.known == {
        0: Judgement(AGREE, "", brightness=0.5),
        1: Judgement(UNKNOWN, "apart", "hits", (2, 3)),
        2: ENDED,
    }
    assert Record(4, path).known == {}
    assert summary(list(again.known.values())).startswith("3 scenes: 1 agree, 0 rounding")
    assert summary(list(again.known.values())).endswith("1 not rendered, 1 unknown")


# ------------------------------------------------------------------- both renderers


@pytest.mark.parametrize("part", range(PARTS))
def test_scenes_of_a_fixed_seed_agree(part, tmp_path):
    """Each takes Mitsuba's paths, or differs for a known reason; nearly all are replayed.

    A false alarm is not possible: seed and random numbers are fixed.
    """
    scenes, size = Scenes(SEED), COUNT // PARTS
    numbers = range(part * size, (part + 1) * size)
    with MitsubaWorker(time_limit=120.0) as worker:
        judge = Judge(render_ours, worker.render, tmp_path)
        found = {number: judge.judge(scenes.draw(number)) for number in numbers}
    unknown = {k: j.sentence for k, j in found.items() if j.verdict in UNCLASSED}
    assert not unknown
    verdicts = Counter(j.verdict for j in found.values())
    assert verdicts[REFUSED] <= size // 8
    # of 1,200 scenes 88 % show light; fewer than 60 % of 25 by chance: 7e-5
    assert sum(j.brightness > 0.0 for j in found.values()) >= 0.6 * size


def test_changes_of_a_scene_are_as_small_as_roundings_and_keep_whole_numbers():
    root = fromstring(
        '<scene><integrator type="path"><integer name="max_depth" value="7"/></integrator>'
        '<sensor type="perspective"><transform name="to_world"><translate x="2.5"/>'
        '</transform></sensor><shape type="sphere"><point name="p" value="1.5, 0, -3"/>'
        '<float name="radius" value="2e-3"/></shape></scene>'
    )
    turned, changed = [], []
    for scene in changed_scenes(root):
        assert scene.find(".//integer").get("value") == "7"
        few = turned if scene.find(".//rotate") is not None else changed
        few.append(scene.find(".//point").get("value"))
    assert len(turned) == len(changed) == AXES
    assert set(turned) == {"1.5, 0, -3"}
    x = [float(value.split(",")[0]) for value in changed]
    assert {round(one, 9) for one in x} == {1.499985, 1.500015}
    assert {value.split(", ", 1)[1] for value in changed} == {"0, -3"}


def test_scenes_that_cannot_run_a_defect_are_passed_over():
    """Those without the plugin whose file it edits; other files may be run by any scene."""
    acne, disk = named(["fixed-epsilon", "disk-is-a-square"])
    scenes = [Scenes(SEED).draw(number).root for number in range(12)]
    assert all(may_reach(disk, r) == bool(plugins(r, "shape", "disk")) for r in scenes)
    assert {bool(plugins(root, "shape", "disk")) for root in scenes} == {True, False}
    assert all(may_reach(acne, root) for root in scenes)
