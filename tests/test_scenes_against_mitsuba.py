"""Scenes with random numbers of our own, by both renderers: the harness must say "pass"."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_ref.cache import ReferenceCache
from mitsuba_ref.options import Options
from mitsuba_ref.ours import render_ours
from mitsuba_ref.validation import validate_scene
from mitsuba_ref.worker import MitsubaWorker

# Replays with Mitsuba's numbers (test_replay_scenes.py) see more in less time. These show
# that our own samplers and leaner methods agree too: point lights and ray trees without
# noise, area lights, a filter of its own, the sky, and AOVs.
QUICK = (
    "appel-teapot",
    "cornell-box",
    "cropped-film",
    "depth-and-normals",
    "grey-furnace",
    "kaleidoscope",
    "whitted-spheres",
)

SCENES = sorted((Path(__file__).parent.parent / "scenes").glob("*/scene.xml"))

WITH_OUR_OWN_NUMBERS = [scene for scene in SCENES if scene.parent.name in QUICK]


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def test_there_are_ten_scenes_or_more():
    """An empty folder would pass every test below."""
    assert len(SCENES) >= 10
    assert len(WITH_OUR_OWN_NUMBERS) == len(QUICK)


@pytest.mark.parametrize("scene", WITH_OUR_OWN_NUMBERS, ids=lambda scene: scene.parent.name)
def test_scene_agrees_with_mitsuba(scene, references):
    """Finite values, AOVs off the silhouettes, and RMSE within what noise explains."""
    options = Options(size="test", checks="statistics")
    result = validate_scene(scene, options, render_ours, references).result
    assert (result.verdict, result.reasons) == ("pass", ())


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.parent.name)
def test_scene_agrees_with_mitsuba_at_full_size(scene, references):
    """Every scene at the size of the demo, where less bias hides in the noise."""
    options = Options(size="demo", checks="statistics")
    result = validate_scene(scene, options, render_ours, references).result
    assert (result.verdict, result.reasons) == ("pass", ())
