"""The AOVs that a file lists, compared channel by channel with all their samples.

Of an `aov` without an integrator inside Mitsuba's picture is nothing else.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.records.request import OF_FILE
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.reference.render import listed_aovs

SCENE = """<scene version="3.0.0">{integrator}
<sensor type="perspective"><float name="fov" value="45"/>
  <transform name="to_world"><lookat origin="0,1,4" target="0,0,0" up="0,1,0"/></transform>
  <sampler type="independent"><integer name="sample_count" value="{spp}"/></sampler>
  <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/>
    <string name="pixel_format" value="{format}"/><rfilter type="{filter}"/></film></sensor>
<emitter type="constant"/><shape type="sphere"/>
</scene>"""
AOV = '<integrator type="aov"><string name="aovs" value="{}"/>{}</integrator>'
PATH = '<integrator type="path"/>'
AROUND = '<integrator type="moment">{}</integrator>'
BOTH = "pos:position,dd:depth"


def scene_file(folder, integrator, spp=4, pixels="rgb", rfilter="box"):
    path = folder / "scene.xml"
    text = SCENE.format(integrator=integrator, spp=spp, format=pixels, filter=rfilter)
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def result_of(path, references, render=render_ours):
    return validate_scene(path, Options(replay=(1,)), render, references).result


CASES = {
    "alone": (AOV.format(BOTH, ""), ["pos", "dd"]),
    "one number": (AOV.format("dd:depth", ""), ["dd"]),
    "two numbers": (AOV.format("st:uv,a:albedo,i:shape_index", ""), ["st", "a"]),
    "around path": (AOV.format(BOTH, PATH), ["pos", "dd"]),
    "moments": (AROUND.format(AOV.format("dd:depth", "")), ["_arg_0.dd", "m2__arg_0.dd"]),
    "around moments": (AOV.format("dd:depth", AROUND.format(PATH)), ["dd"]),
}


@pytest.mark.parametrize("case", CASES)
def test_aovs_of_the_file_are_compared(case, references, tmp_path):
    integrator, names = CASES[case]
    result = result_of(scene_file(tmp_path, integrator), references)
    assert result.verdict == "pass", result.reasons
    compared = [name for name in result.metrics if name.startswith(OF_FILE)]
    assert compared == [OF_FILE + name for name in names]
    assert all(replay.passed for replay in result.replay)


@pytest.mark.parametrize(("pixels", "rfilter"), [("rgba", "box"), ("rgb", "gaussian")])
def test_whatever_the_film_is(pixels, rfilter, references, tmp_path):
    path = scene_file(tmp_path, AOV.format(BOTH, ""), 4, pixels, rfilter)
    assert result_of(path, references).verdict == "pass"


@pytest.mark.parametrize("integrator", [AOV.format(BOTH, ""), AOV.format(BOTH, PATH)])
def test_a_defect_in_a_later_aov_fails_by_its_name(integrator, references, tmp_path):
    """The picture of the first one, or of the colours, agrees."""

    def deeper(request):
        ours = render_ours(request)
        name = f"{OF_FILE}dd"
        if name not in ours.arrays:
            return ours
        arrays = ours.arrays | {name: ours.arrays[name] * np.float32(1.3)}
        return dataclasses.replace(ours, arrays=arrays)

    path = scene_file(tmp_path, integrator, 64)
    result = result_of(path, references, deeper)
    assert result.verdict == "fail"
    assert [reason.split(" over ")[0].rsplit(" ", 1)[0] for reason in result.reasons] == [
        f"{OF_FILE}dd"
    ]


def test_channels_of_integrators_inside_are_no_aovs():
    """Their alpha is named, and in a film of three colours not there."""
    pixels = np.arange(9.0, dtype=np.float32).reshape(1, 1, 9)
    names = ["a.R", "a.G", "a.B", "a.A", "b.R", "b.G", "b.B", "b.A", "n.X", "n.Y", "n.Z"]
    found = listed_aovs(names, pixels)
    assert list(found) == [f"{OF_FILE}n"]
    assert found[f"{OF_FILE}n"].ravel().tolist() == [6.0, 7.0, 8.0]
