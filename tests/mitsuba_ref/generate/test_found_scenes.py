"""What scenes at random have found: mended in the harness, or a fault that is told."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mitsuba_ref.generate.drawing import DrawnScene
from mitsuba_ref.generate.faults import KNOWN_FAULTS
from mitsuba_ref.generate.files import png_bytes
from mitsuba_ref.generate.judge import AGREE, FAULT, UNKNOWN, Judge, Judgement
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay.explained_pixel import _begin_apart

SCENE = """<scene version="3.0.0"><integrator type="{integrator}">{inside}</integrator>
<sensor type="perspective"><transform name="to_world">
<lookat origin="0.3, 1, 3" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="5"/>
<string name="pixel_format" value="{pixels}"/></film></sensor>{content}</scene>"""
HIDDEN = '<boolean name="hide_emitters" value="true"/>'
LAMP = '<emitter type="point"><point name="position" value="0, 1, 3"/></emitter>'
INSTANCE = """<shape type="shapegroup" id="group"><shape type="rectangle"/></shape>
<shape type="instance"><ref id="group"/></shape>"""
SKY = """<shape type="rectangle"/><emitter type="sunsky"><spectrum type="irregular"
name="albedo"><string name="wavelengths" value="400, 500, 700"/>
<string name="values" value="0.7, 0.7, 0.1"/></spectrum>
<vector name="sun_direction" value="0, 0.5, 0.8"/></emitter>"""
TURNED_BUMPS = """<shape type="rectangle"><bsdf type="bumpmap"><bsdf type="diffuse"/>
<texture type="bitmap"><boolean name="raw" value="true"/>
<string name="filename" value="column.png"/><transform name="to_uv">
<scale x="1.6" y="0.04"/><rotate z="1" angle="53"/></transform></texture></bsdf></shape>"""
COLUMN = {"column.png": png_bytes(np.array([[[0.2]], [[0.8]]]), 8)}
AOVS = '<string name="aovs" value="n:geo_normal"/><integrator type="path" name="inside"/>'


@pytest.fixture(scope="module")
def judge(tmp_path_factory):
    with MitsubaWorker(time_limit=120.0) as worker:
        yield Judge(render_ours, worker.render, tmp_path_factory.mktemp("found"))


def scene(integrator, content, inside="", pixels="rgb", files=None):
    text = SCENE.format(
        integrator=integrator, content=content, inside=inside, pixels=pixels
    )
    root = ET.fromstring(text)
    for element in root.iter():
        element.text = element.tail = None
    return DrawnScene(root, files or {})


@pytest.mark.parametrize(
    "drawn",
    [
        scene("whitted", INSTANCE + LAMP, HIDDEN),
        scene("aov", '<shape type="rectangle"/>' + LAMP, AOVS, "rgba"),
        scene("path", SKY),
        scene("path", TURNED_BUMPS + LAMP, files=COLUMN),
    ],
    ids=[
        "whitted hides lamps from instances",
        "colours of aov in rgba",
        "ground of a sky",
        "slopes of an image of one column, turned",
    ],
)
def test_what_was_mended_agrees(drawn, judge):
    found = judge.judge(drawn)
    assert found.verdict == AGREE, found.sentence
    assert found.brightness > 0.0


def test_path_still_ends_where_it_hides_lamps_and_meets_an_instance(judge):
    """If this agrees, Mitsuba has mended it: docs/mitsuba-faults.md, and `KNOWN_FAULTS`."""
    found = judge.judge(scene("path", INSTANCE + LAMP, HIDDEN))
    assert found.verdict == FAULT
    assert found.quantity == "path ends where it hides lamps and meets an instance"


def test_a_number_that_one_side_does_not_draw_shifts_nothing():
    """Ours has none for the time of an open shutter."""
    assert not _begin_apart({"film x": 0.5}, {"film x": 0.5, "time": 0.1})
    assert _begin_apart({"film x": 0.5}, {"film x": 0.25, "time": 0.1})


@pytest.mark.parametrize(("error", "may_be"), [(2e-5, True), (2e-3, False), (0.0, False)])
def test_what_rounds_in_mitsuba_explains_no_more_than_its_rounding(error, may_be):
    """0 stands for an error that has no number."""
    rounded = [fault for fault in KNOWN_FAULTS if fault.most < np.inf]
    assert len(rounded) >= 3
    for fault in rounded:
        assert fault.explains(fault.quantities[0], error) == may_be


def test_no_scene_is_judged_twice(monkeypatch, tmp_path):
    """The same faults left out in another order are the same scene: 2^4, not e 4!."""
    content = """<shape type="linearcurve"/><shape type="cylinder">
<float name="radius" value="0.01"/></shape><emitter type="sunsky">
<boolean name="complex_sun" value="true"/></emitter><sampler type="stratified">
<boolean name="jitter" value="false"/><integer name="sample_count" value="4"/></sampler>"""
    drawn = scene("path", content)
    judged = []

    def judge(self, one):
        judged.append(ET.tostring(one.root))
        return Judgement(UNKNOWN, "")

    monkeypatch.setattr(Judge, "_judge", judge)
    found = Judge(None, None, tmp_path).judge(drawn)
    assert found.verdict == UNKNOWN
    assert len(judged) == len(set(judged)) >= 16
