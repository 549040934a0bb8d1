"""What scenes at random have found: mended in the harness, or a fault that is told."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mitsuba_ref.generate.drawing import DrawnScene
from mitsuba_ref.generate.faults import KNOWN_FAULTS, NOT_FINITE
from mitsuba_ref.generate.files import png_bytes
from mitsuba_ref.generate.judge import AGREE, FAULT, REFUSED, UNKNOWN, Judge, Judgement
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
VALLEY = [f"v {x} {y} {x * x}" for y in (-1, 1) for x in (-1.0, -0.5, 0.0, 0.5, 1.0)]
VALLEY += [f"f {i} {i + 1} {i + 6} {i + 5}" for i in range(1, 5)]
GLOWING_VALLEY = """<shape type="obj"><string name="filename" value="valley.obj"/>
<transform name="to_world"><scale value="0.003"/></transform>
<emitter type="area"/></shape>"""
CLOSE = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="0.4"/>
<transform name="to_world"><lookat origin="0, 0, 1" target="0, 0, 0" up="0, 1, 0"/>
</transform><film type="hdrfilm"><integer name="width" value="16"/>
<integer name="height" value="16"/></film>
<sampler type="independent"><integer name="sample_count" value="64"/></sampler></sensor>
<integrator type="{integrator}"/>{content}</scene>"""
POLES = """<shape type="rectangle"/><emitter type="envmap">
<string name="filename" value="poles.png"/><boolean name="mis_compensation" value="true"/>
</emitter>"""
BRIGHT_POLES = {"poles.png": png_bytes(np.array([[[0.9]], [[0.3]], [[0.8]]]), 8)}
GLASS_LAMP = """<shape type="sphere"><float name="radius" value="2"/>
<bsdf type="roughdielectric"/><emitter type="area"/></shape>"""
COLUMN = {"column.png": png_bytes(np.array([[[0.2]], [[0.8]]]), 8)}
MIRRORED = """<shape type="rectangle">{bsdf}<transform name="to_world">
<scale x="-1"/></transform></shape>"""
BUMPS = """<bsdf type="bumpmap" id="shared"><bsdf type="diffuse"/><texture
type="uniform"><float name="value" value="0.5"/></texture></bsdf>"""
ENDLESS = """<emitter type="constant"/><shape type="cube"><transform name="to_world">
<scale value="9"/></transform><boolean name="flip_normals" value="true"/>
<bsdf type="null"/><medium type="homogeneous" name="interior">
<float name="sigma_t" value="0.1"/></medium></shape>"""
NORMALS = '<string name="aovs" value="n:geo_normal"/>'
AOVS = '<string name="aovs" value="n:geo_normal"/><integrator type="path" name="inside"/>'


@pytest.fixture(scope="module")
def judge(tmp_path_factory):
    with MitsubaWorker(time_limit=120.0) as worker:
        yield Judge(render_ours, worker.render, tmp_path_factory.mktemp("found"))


def scene(integrator, content, inside="", pixels="rgb", files=None, frame=SCENE):
    text = frame.format(
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
        scene(
            "path",
            GLOWING_VALLEY,
            files={"valley.obj": "\n".join(VALLEY).encode()},
            frame=CLOSE,
        ),
    ],
    ids=[
        "whitted hides lamps from instances",
        "colours of aov in rgba",
        "ground of a sky",
        "slopes of an image of one column, turned",
        "a lamp that is seen from behind from where the ray began, but for its offset",
    ],
)
def test_what_was_mended_agrees(drawn, judge):
    found = judge.judge(drawn)
    assert found.verdict == AGREE, found.sentence
    assert found.brightness > 0.0


def test_a_sky_that_shines_at_its_poles_alone_is_refused(judge):
    """Mitsuba's densities there are the rounding of a sine."""
    found = judge.judge(scene("path", POLES, files=BRIGHT_POLES))
    assert found.verdict == REFUSED
    assert "more than its mean" in found.sentence


def test_nan_in_mitsubas_picture_may_have_a_known_cause(judge):
    found = judge.judge(scene("volpath", GLASS_LAMP, frame=CLOSE))
    assert found.verdict == FAULT
    assert found.quantity == "a sphere that shines lights itself from inside"
    assert not any(fault.explains(NOT_FINITE, 0.0) for fault in KNOWN_FAULTS)


def test_path_still_ends_where_it_hides_lamps_and_meets_an_instance(judge):
    """If this agrees, Mitsuba has mended it: docs/mitsuba-faults.md, and `KNOWN_FAULTS`."""
    found = judge.judge(scene("path", INSTANCE + LAMP, HIDDEN))
    assert found.verdict == FAULT
    assert found.quantity == "path ends where it hides lamps and meets an instance"


@pytest.mark.parametrize(
    ("drawn", "fault"),
    [
        (
            scene("aov", MIRRORED.format(bsdf=""), NORMALS),
            "geo_normal of a mirrored rectangle",
        ),
        (
            scene("path", BUMPS + MIRRORED.format(bsdf='<ref id="shared"/>') + LAMP),
            "bumps on a mirrored rectangle",
        ),
    ],
    ids=["geometric normals", "bumps of a shared BSDF"],
)
def test_what_is_a_known_fault(drawn, fault, judge):
    found = judge.judge(drawn)
    assert (found.verdict, found.quantity) == (FAULT, fault), found.sentence


def test_shadow_rays_end_where_mitsubas_end(judge):
    """In a medium without end their length decides how much light arrives."""
    found = judge.judge(scene("volpath", ENDLESS))
    assert found.verdict == AGREE, found.sentence


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
