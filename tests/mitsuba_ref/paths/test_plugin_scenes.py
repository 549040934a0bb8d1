"""One small scene for each plugin (tests/plugins/*.xml): the same paths as Mitsuba's.

A file shows one plugin, or one family, with everything that its properties can do. As for
the scenes of scenes/: with Mitsuba's random numbers at 1 and at 16 samples, 99.9 % of the
pixels within 3e-4 and the RMSE of these below 1e-5 of the mean. With numbers of its own
each renderer must have the same mean, which `make test-all` looks at with eight seeds.
A proof.toml's `[replay]` table may stand next to a file as NAME.toml, with its reason.
"""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.ladder.aovs import compare_aovs
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF, USUAL_LIMITS, ReplayLimits
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.reference.plugins.known_faults import TURNED
from mitsuba_ref.replay.replay_scene import replay_scene

WRONG = ("volpathmis",)  # in the mean, which a replay follows (docs/mitsuba-faults.md)
SCENES = sorted((Path(__file__).parents[2] / "plugins").glob("*.xml"))


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def limits_of(scene):
    beside = scene.with_suffix(".toml")
    if not beside.exists():
        return USUAL_LIMITS
    return msgspec.convert(tomllib.loads(beside.read_text())["replay"], ReplayLimits)


@pytest.mark.parametrize("spp", [1, 16])
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_a_plugin_takes_mitsubas_paths(scene, spp, references):
    request = scene_request(scene, NO_PROOF, Options())
    result, _, _ = replay_scene(request, spp, render_ours, references, limits_of(scene))
    assert result.passed, result.sentence


@pytest.mark.parametrize(
    ("scene", "integrator"),
    [
        ("hidden_sky", "volpath"),  # lamps are hidden to rays that go straight on
        ("hidden_sky", "volpathmis"),
        ("bumpmap", "volpathmis"),  # draws once more where a path ends in black
    ],
)
def test_a_plugin_takes_the_paths_of_another_integrator(
    scene, integrator, references, tmp_path
):
    folder = shutil.copytree(SCENES[0].parent, tmp_path / "plugins")
    changed = folder / f"{scene}.xml"
    text = changed.read_text()
    assert text.count('<integrator type="path">') == 1
    changed.write_text(text.replace('type="path"', f'type="{integrator}"'))
    request = scene_request(changed, NO_PROOF, Options())
    result, _, _ = replay_scene(request, 16, render_ours, references)
    assert result.passed, result.sentence


def test_normals_of_bump_maps_are_compared_in_the_world(references):
    """Mitsuba's are turned into it; ours are right where u and v span no area too."""
    scene = next(scene for scene in SCENES if scene.stem == "bumpmap")
    request = replace(scene_request(scene, NO_PROOF, Options()), kind="aovs", spp=None)
    ours, reference = render_ours(request), references.get(request, [scene])
    assert TURNED in reference.changes
    for found in compare_aovs(ours.arrays, reference.arrays):
        assert found.passed, found


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_a_plugin_has_mitsubas_mean(scene, references):
    """The ladder, with eight pictures of each renderer."""
    options = Options(ladder=True, seeds=8, spp=64, checks="statistics")
    result = validate_scene(scene, options, render_ours, references).result
    verdict = "reference-wrong" if scene.stem in WRONG else "pass"
    assert result.verdict == verdict, result.reasons
