"""Scenes with random numbers of our own, by both renderers: the harness must say "pass"."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_plugin_scenes import SCENES as PLUGIN_SCENES
from test_replay_scenes import QUICK as REPLAYED

from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

# Replays with Mitsuba's numbers (test_replay_scenes.py) see more. These are the scenes that
# `make test` does not replay, as each compiles its kernels anew, 10 to 25 seconds: point
# lights and trees of rays without noise, AOVs, furnaces, filters of the file's own. They
# show that our own samplers and leaner methods agree too. `make test-all` compares all of
# the scenes in both ways.
QUICK = (
    "appel-teapot",
    "colour-bleeding",
    "cropped-film",
    "depth-and-normals",
    "evening-sky",
    "grey-furnace",
    "kaleidoscope",
    "many-lights",
    "mist",
    "white-furnace",
    "whitted-spheres",
)

# What these show is replayed by the small scenes of tests/plugins (test_plugin_scenes.py).
BY_PLUGINS = {
    "bumps": ("normalmap", "bumpmap"),
    "leaves": ("mask", "blendbsdf"),
    "measured-ball": ("merl",),
    "principled-gallery": ("principled",),
    "rough-materials": ("roughconductor", "roughdielectric", "roughplastic", "plastic"),
}

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*/scene.xml"))

WITH_OUR_OWN_NUMBERS = [scene for scene in SCENES if scene.parent.name in QUICK]


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def test_every_scene_is_compared_in_make_test():
    """Here, by a replay, or by plugins: a new scene has to be added to one of the lists.

    A name without a folder, or an empty folder, would leave tests out without a word.
    """
    assert len(SCENES) >= 10
    listed = {*QUICK, *REPLAYED, *BY_PLUGINS}
    assert listed == {scene.parent.name for scene in SCENES}
    plugins = {scene.stem for scene in PLUGIN_SCENES}
    assert all(plugins.issuperset(shown) for shown in BY_PLUGINS.values())


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
