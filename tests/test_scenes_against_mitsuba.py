"""Every scene of scenes/, rendered small by both renderers: the harness must say "pass"."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_ref.cache import ReferenceCache
from mitsuba_ref.options import Options
from mitsuba_ref.ours import render_ours
from mitsuba_ref.validation import validate_scene
from mitsuba_ref.worker import MitsubaWorker

SCENES = sorted((Path(__file__).parent.parent / "scenes").glob("*/scene.xml"))


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def test_there_are_ten_scenes_or_more():
    """An empty folder would pass every test below."""
    assert len(SCENES) >= 10


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.parent.name)
def test_scene_agrees_with_mitsuba(scene, references):
    """Finite values, AOVs off the silhouettes, and RMSE within what noise explains."""
    result = validate_scene(scene, Options(size="test"), render_ours, references).result
    assert (result.verdict, result.reasons) == ("pass", ())


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.parent.name)
def test_scene_agrees_with_mitsuba_at_full_size(scene, references):
    """The same at the size of the demo, where less bias hides in the noise."""
    result = validate_scene(scene, Options(size="demo"), render_ours, references).result
    assert (result.verdict, result.reasons) == ("pass", ())
