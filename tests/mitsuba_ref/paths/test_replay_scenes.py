"""Every scene of scenes/ with Mitsuba's random numbers: the same paths, pixel by pixel.

There is no noise between the two pictures, so a difference is a defect. At 1 and at 16
samples per pixel at least 99.9 % of the pixels are within 3e-4, and the RMSE of these is
below 1e-5 of the mean (`mitsuba_ref.replay`); a scene with wider limits gives a reason.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay.replay_scene import replay_scene

# What `make test` has the time for, as each compiles its kernels: every shape, BSDF and
# area light, textures, vertex normals, instances. The other scenes are compared by
# statistics there, or plugin by plugin (test_scenes_against_mitsuba.py); `make test-all`
# replays them all.
QUICK = (
    "analytic-shapes",
    "caustic",
    "cornell-box",
    "emitters",
    "instances",
    "metals",
    "smooth-mesh",
    "textured-room",
)

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*/scene.xml"))


def scenes():
    """Return all scenes, those that take too long for `make test` marked as slow."""
    return [
        pytest.param(
            scene,
            id=scene.parent.name,
            marks=() if scene.parent.name in QUICK else pytest.mark.slow,
        )
        for scene in SCENES
    ]


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def request_for(scene, size="test", **fields):
    request = scene_request(scene, read_proof(scene), Options(size=size))
    return replace(request, **fields)


@pytest.mark.parametrize("spp", [1, 16])
@pytest.mark.parametrize("scene", scenes())
def test_scene_takes_mitsubas_paths(scene, spp, references):
    limits = read_proof(scene).replay
    result, _, _ = replay_scene(request_for(scene), spp, render_ours, references, limits)
    assert result.passed, result.sentence


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.parent.name)
def test_scene_takes_mitsubas_paths_at_full_size(scene, references):
    """At the size of the demo, on films of many blocks."""
    request = request_for(scene, "demo", seed=7)
    limits = read_proof(scene).replay
    result, _, _ = replay_scene(request, 16, render_ours, references, limits)
    assert result.passed, result.sentence
