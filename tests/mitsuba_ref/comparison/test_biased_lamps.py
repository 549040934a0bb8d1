"""Lamps with vertex normals, which Mitsuba samples with a bias: what the verdict is.

Its density goes by the cosine of the interpolated normal instead of the triangle's own.
"""

from __future__ import annotations

import numpy as np
import pytest
from mitsuba_stand_in import scaled
from serialized_files import Mesh as SerializedMesh
from serialized_files import serialized

import renderer
from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.reference.plugins.known_faults import TURNED_AWAY, has_biased_lamps

SCENE = """<scene version="3.0.0">
{integrator}
<sensor type="perspective"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
  <sampler type="independent"><integer name="sample_count" value="32"/></sampler>
  <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/>
    <rfilter type="box"/></film></sensor>
<shape type="{plugin}"><string name="filename" value="lamp.{plugin}"/>
  <transform name="to_world"><rotate x="1" angle="60"/><translate y="1.5" z="0.3"/>
  </transform>{lamp}</shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
  <scale value="4"/><translate y="-1"/></transform><bsdf type="diffuse"/></shape>
<shape type="sphere"><bsdf type="diffuse"/></shape>
{more}
</scene>"""
AREA = '<emitter type="area"><rgb name="radiance" value="6"/></emitter>'
PATH = '<integrator type="path"><integer name="max_depth" value="4"/></integrator>'
LIGHTS = """<emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>
<emitter type="point"><point name="position" value="1,2,2"/></emitter>"""
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
TILTED = (0.6, 0.0, 0.8)
FLAT = (0.0, 0.0, 1.0)


def write_lamp(folder, plugin, normal):
    """Write a square with the same normal at each vertex; without one Mitsuba makes it."""
    path = folder / f"lamp.{plugin}"
    if plugin == "serialized":
        mesh = SerializedMesh(CORNERS, FACES, np.tile(normal, (4, 1)))
        path.write_bytes(serialized([mesh], 4))
    elif plugin == "ply":
        names = "".join(f"property float {name}\n" for name in "x y z nx ny nz".split())
        rows = [f"{x} {y} {z} {' '.join(map(str, normal))}" for x, y, z in CORNERS]
        faces = [f"3 {a} {b} {c}" for a, b, c in FACES]
        header = f"ply\nformat ascii 1.0\nelement vertex 4\n{names}"
        header += "element face 2\nproperty list uchar int vertex_indices\nend_header"
        path.write_text("\n".join([header, *rows, *faces]) + "\n")
    else:
        rows = [f"v {x} {y} {z}" for x, y, z in CORNERS]
        faces = [" ".join(f"{i + 1}//1" for i in face) for face in FACES]
        normal = f"vn {' '.join(map(str, normal))}"
        path.write_text("\n".join([*rows, normal, *(f"f {f}" for f in faces)]) + "\n")


def scene_file(
    folder, plugin="obj", normal=TILTED, integrator=PATH, lamp=AREA, more="", write=True
):
    if write:
        write_lamp(folder, plugin, normal)
    path = folder / "scene.xml"
    text = SCENE.format(integrator=integrator, plugin=plugin, lamp=lamp, more=more)
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


def result_of(path, references, render=render_ours):
    return validate_scene(path, Options(replay=(4,)), render, references).result


DIRECT = '<integrator type="direct"><integer name="{}" value="0"/></integrator>'
OTHER_BLOCKS = '<integer name="block_size" value="16"/>'
AROUND = '<integrator type="aov"><string name="aovs" value="d:depth"/>{}</integrator>'
WRONG = {
    "obj": {},
    "ply": {"plugin": "ply"},
    "serialized": {"plugin": "serialized"},
    "with other lights": {"more": LIGHTS},
    "light samples alone": {"integrator": DIRECT.format("bsdf_samples")},
    "inside of aov": {"integrator": AROUND.format(PATH)},
    "volpathmis": {"integrator": PATH.replace("path", "volpathmis")},
    "not replayable": {"integrator": PATH.replace("><", f">{OTHER_BLOCKS}<", 1)},
}


@pytest.mark.parametrize("case", WRONG)
def test_the_bias_of_the_reference_is_a_verdict_of_its_own(case, references, tmp_path):
    """Ours is right: with such lamps found by BSDF samples alone Mitsuba agrees."""
    result = result_of(scene_file(tmp_path, **WRONG[case]), references)
    assert result.verdict == "reference-wrong", result.reasons
    assert "lamps with vertex normals" in result.reasons[0]
    assert result.reasons[0].endswith("on its side, the pictures agree")
    assert all(replay.passed for replay in result.replay)
    assert bool(result.replay) == (case != "not replayable")


RIGHT = {
    "flat": {"normal": FLAT},
    "no light samples": {"integrator": DIRECT.format("emitter_samples")},
    "whitted": {"integrator": PATH.replace("path", "whitted")},
}


@pytest.mark.parametrize("case", RIGHT)
def test_where_there_is_no_bias_it_is_a_pass(case, references, tmp_path):
    """Vertex normals that are the triangle's; lamps that nothing samples; and `whitted`.

    The harness's own model of `whitted` goes by the triangles' normals.
    """
    result = result_of(scene_file(tmp_path, **RIGHT[case]), references)
    assert result.verdict == "pass", result.reasons


@pytest.mark.parametrize(("factor", "replay"), [(1.04, False), (1.0001, True)])
def test_a_defect_of_ours_fails_all_the_same(factor, replay, references, tmp_path):
    """The light of such a lamp is compared, with noise and with the same numbers."""
    path = scene_file(tmp_path)
    result = result_of(path, references, scaled(factor, replay=replay))
    assert result.verdict == "fail"


def biased(folder, **settings):
    return has_biased_lamps(renderer.load_file(scene_file(folder, **settings)).description)


@pytest.mark.parametrize(("times", "counts"), [(0.5, False), (2.0, True)])
def test_normals_count_from_a_distance_on(times, counts, tmp_path):
    angle = times * TURNED_AWAY
    assert biased(tmp_path, normal=(np.sin(angle), 0.0, np.cos(angle))) == counts
    assert biased(tmp_path, normal=(np.sin(angle), 0.0, -np.cos(angle))) == counts


def test_a_lamp_without_normals_in_its_file_has_those_that_are_made(tmp_path):
    """Mitsuba's OBJ gets normals at its vertices, between faces that share them."""
    tent = "v -1 0 0\nv 0 -1 1\nv 1 0 0\nv 0 1 1\nf 1 2 4\nf 2 3 4\n"
    (tmp_path / "lamp.obj").write_text(tent)
    assert biased(tmp_path, write=False)
    faceted = '<boolean name="face_normals" value="true"/>'
    assert not biased(tmp_path, write=False, lamp=AREA + faceted)
    assert not biased(tmp_path, write=False, lamp="")
