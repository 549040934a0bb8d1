"""Mitsuba's `hair` samples its last lobe in wrong directions: a verdict of its own."""

from __future__ import annotations

import pytest
from mitsuba_stand_in import scaled

from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

# seen along the fibre; the lamp is around the mirrored direction
SCENE = """<scene version="3.0.0">
  <integrator type="direct"><integer name="emitter_samples" value="0"/></integrator>
  <sensor type="orthographic">
    <transform name="to_world"><scale x="0.001" y="0.001"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
      <rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="1024"/></sampler>
  </sensor>
  <shape type="sphere"><point name="center" x="0.7" y="0.2" z="1.9"/>
    <emitter type="area"/></shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="0.01"/><rotate x="1" angle="-98"/>
      <rotate y="1" angle="36"/><translate z="1"/></transform>
    {bsdf}
  </shape>
</scene>
"""
HAIR = '<bsdf type="hair"><float name="eumelanin" value="{}"/>{}</bsdf>'
NO_PHEOMELANIN = '<float name="pheomelanin" value="0"/>'
WHITE = HAIR.format(0, NO_PHEOMELANIN)
BLACK = HAIR.format(50, "")
IN_BLEND = f"""<bsdf type="blendbsdf"><float name="weight" value="0.9"/>
<bsdf type="diffuse"/>{WHITE}</bsdf>"""
TEXTURED = """<bsdf type="hair"><texture name="sigma_a" type="checkerboard">
<rgb name="color0" value="0, 0, 0.01"/><rgb name="color1" value="0, 0.02, 0"/></texture>
<float name="scale" value="0.5"/>
<float name="longitudinal_roughness" value="0.4"/></bsdf>"""


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def result_of(folder, references, bsdf, render=render_ours):
    path = folder / "scene.xml"
    path.write_text(SCENE.format(bsdf=bsdf))
    return validate_scene(path, Options(replay=(4,)), render, references).result


@pytest.mark.parametrize(
    "bsdf", [WHITE, IN_BLEND, TEXTURED], ids=["white", "blend", "textured"]
)
def test_the_fault_is_a_verdict_of_its_own(bsdf, references, tmp_path):
    """With the samples in their place Mitsuba agrees. A replay follows the fault."""
    result = result_of(tmp_path, references, bsdf)
    assert result.verdict == "reference-wrong", result.reasons
    assert "in the last lobe of hair" in result.reasons[0]
    assert result.replay and all(replay.passed for replay in result.replay)


def test_where_it_does_not_show_it_is_a_pass(references, tmp_path):
    result = result_of(tmp_path, references, BLACK)
    assert result.verdict == "pass", result.reasons


def test_a_defect_of_ours_fails_all_the_same(references, tmp_path):
    assert result_of(tmp_path, references, WHITE, render=scaled(0.8)).verdict == "fail"
