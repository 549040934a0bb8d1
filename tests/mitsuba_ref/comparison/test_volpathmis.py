"""`volpathmis` is wrong in the mean in some scenes: what the verdict is there."""

from __future__ import annotations

import pytest
from mitsuba_stand_in import scaled

import renderer
from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.reference.plugins.volpathmis import faults_of

SCENE = """<scene version="3.0.0">
<integrator type="{plugin}"><integer name="max_depth" value="{depth}"/>
  <integer name="rr_depth" value="{roulette}"/>{more}</integrator>
<sensor type="perspective"><float name="fov" value="15"/>
  <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
  <sampler type="independent"><integer name="sample_count" value="{spp}"/></sampler>
  <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="12"/>
    <rfilter type="box"/></film></sensor>
<emitter type="constant"><rgb name="radiance" value="0.8, 0.9, 1"/></emitter>
<shape type="sphere"><bsdf type="null"/><medium type="homogeneous" name="interior">
  <rgb name="sigma_t" value="{sigma_t}"/><float name="scale" value="{scale}"/>
  <float name="albedo" value="{albedo}"/>
  <boolean name="has_spectral_extinction" value="{spectral}"/></medium></shape>
{shapes}
</scene>"""
USUAL = {
    "plugin": "volpathmis",
    "depth": 64,
    "roulette": 100,
    "more": "",
    "spp": 64,
    "sigma_t": "0.9, 0.9, 0.9",
    "scale": 1.0,
    "albedo": 1.0,
    "spectral": "true",
    "shapes": "",
}
FLOOR = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
CLEAR = """<shape type="sphere"><float name="radius" value="2"/><bsdf type="null"/>
<boolean name="flip_normals" value="true"/>
<emitter type="area"><rgb name="radiance" value="0.1"/></emitter></shape>"""
TINTED = """
<shape type="sphere"><float name="radius" value="2"/><bsdf type="thindielectric">
<rgb name="specular_transmittance" value="0.3"/></bsdf></shape>"""
TINTED_FILTERS = (
    '<bsdf type="polarizer"/>',
    '<bsdf type="circular"/>',
    '<bsdf type="retarder"><float name="transmittance" value="0.3"/></bsdf>',
)
ONE_DENSITY = '<boolean name="use_spectral_mis" value="false"/>'
OF_MEDIA = "without has_spectral_extinction"  # a fault of `volpath` too
WRONG = {
    "Russian roulette": {"roulette": 1, "spp": 1024, "scale": 5.0, "albedo": 0.8},
    "tinted panes": {"shapes": FLOOR + TINTED},
    "lamps that light passes": {"shapes": FLOOR + CLEAR},
    OF_MEDIA: {"sigma_t": "0.9, 0.5, 0.1", "spectral": "false"},
    "without use_spectral_mis": {
        "more": ONE_DENSITY,
        "shapes": '<shape type="rectangle"><bsdf type="diffuse">'
        '<rgb name="reflectance" value="0.8, 0, 0"/></bsdf></shape>',
    },
}
RIGHT = {
    "usual": {},
    "coloured": {"sigma_t": "0.9, 0.5, 0.1"},
    "one density": {"more": ONE_DENSITY},
}


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def scene_file(folder, **settings):
    path = folder / "scene.xml"
    path.write_text(SCENE.format(**USUAL | settings))
    return path


def result_of(path, references, render=render_ours):
    return validate_scene(path, Options(replay=(4,)), render, references).result


@pytest.mark.parametrize(
    ("words", "plugin"),
    [*((words, "volpathmis") for words in WRONG), (OF_MEDIA, "volpath")],
)
def test_its_faults_are_a_verdict_of_their_own(words, plugin, references, tmp_path):
    """Ours is right: Mitsuba's `volpath` agrees. The replay follows the fault."""
    path = scene_file(tmp_path, **WRONG[words], plugin=plugin)
    result = result_of(path, references)
    assert result.verdict == "reference-wrong", result.reasons
    assert f"in the weights of its paths in media: {words}" in result.reasons[0]
    assert all(replay.passed for replay in result.replay) and result.replay


@pytest.mark.parametrize("case", RIGHT)
def test_where_it_has_none_it_is_a_pass(case, references, tmp_path):
    result = result_of(scene_file(tmp_path, **RIGHT[case]), references)
    assert result.verdict == "pass", result.reasons


def test_a_defect_of_ours_fails_all_the_same(references, tmp_path):
    path = scene_file(tmp_path, **WRONG["Russian roulette"])
    assert result_of(path, references, scaled(0.9)).verdict == "fail"


@pytest.mark.parametrize("words", WRONG)
def test_a_fault_is_named_where_it_may_be(words):
    def named(**settings):
        text = SCENE.format(**USUAL | settings)
        return faults_of(renderer.load_string(text).description)

    assert named() == ""
    assert named(**WRONG[words]).startswith(words)
    if words == "tinted panes":
        assert not named(shapes='<shape type="disk"><bsdf type="retarder"/></shape>')
        for bsdf in TINTED_FILTERS:
            assert named(shapes=f'<shape type="disk">{bsdf}</shape>').startswith(words)
    if words != "without use_spectral_mis":  # volpath has no such property
        of_both = named(**WRONG[words], plugin="volpath")
        assert (of_both != "") == (words == OF_MEDIA)
